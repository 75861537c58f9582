// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "evpose/fusion/block_chain.h"
#include "evpose/fusion/motion_prior.h"
#include "evpose/fusion/preintegration.h"
#include "evpose/fusion/state.h"

namespace evpose {

/// Factor graph over a sliding window of states (EV-Pose eq. 5, 6): what is known of the oldest, between
/// neighbours the motion prior (eq. 2) and the IMU's motion (eq. 4), and pose measurements (eq. 3). Solved by
/// Gauss-Newton.
///
/// States that leave the window leave a prior on the next one, linearised where that state stood then; its
/// vector is moved along when the state moves, its matrix is not made anew. The map makes every direction
/// observable, so there is no null space that an old linearisation could fill with false information.
class Window {
 public:
  /// Without a `prior`, motions alone tie neighbours: they are the prior where there is no IMU.
  explicit Window(const Eigen::Vector3d& gravity_map, const std::optional<MotionPrior>& prior = {})
      : gravity_map_(gravity_map), prior_(prior) {}

  /// The window holds `first` alone, with its covariance as prior; zero variances count as very small.
  void start(const FusionState& first);
  /// A new state, `motion` after the newest. `state` is where it is linearised first; `measurement` is
  /// relative to `measured_at`.
  void add(const Preintegration& motion, const FusionState& state, const PoseInformation& measurement,
           const Pose& measured_at);
  /// A further measurement of the newest state.
  void add_measurement(const PoseInformation& measurement, const Pose& measured_at);
  /// Inter-TS fusion (eq. 5): the newest state alone, by its factors and by what is known of the state before
  /// it. False, and nothing changed, if the equations are not positive definite.
  bool fuse_newest();
  /// Joint optimisation (eq. 6): Gauss-Newton on all states, from where they are. False, and nothing changed,
  /// if the equations are not positive definite.
  bool optimise(int iterations);
  /// Marginalises all states before `t` of those that were optimised; the newest always stays.
  void forget_before(TimeNs t);

  std::size_t size() const { return nodes_.size(); }
  const FusionState& state(std::size_t i) const { return nodes_[i].state; }
  /// The newest state with the covariance of the last fuse_newest() or optimise().
  const FusionState& newest() const { return nodes_.back().state; }

 private:
  struct Node {
    FusionState state;
    Preintegration motion;  ///< from the node before
    PoseInformation measurement;
    Pose measured_at;
  };
  /// The equations at the present states, of the first `count` nodes; the last one's measurement if asked.
  void linearise(std::size_t count, bool newest_measured);
  void add_measured(std::size_t node, std::size_t place);
  void add_motion(std::size_t node, std::size_t place);
  void take_newest();

  Eigen::Vector3d gravity_map_;
  std::optional<MotionPrior> prior_;
  std::deque<Node> nodes_;
  std::size_t fused_ = 0;        ///< node that is fused with all before it,
  Matrix15d fused_information_;  ///< and what is known of it, at its present state
  FusionState prior_at_;         ///< where the prior is linearised
  Matrix15d prior_information_;
  Vector15d prior_vector_;
  BlockChain chain_;
};

}  // namespace evpose
