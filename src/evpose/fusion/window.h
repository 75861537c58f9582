// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <vector>

#include "evpose/fusion/block_chain.h"
#include "evpose/fusion/preintegration.h"
#include "evpose/fusion/state.h"

namespace evpose {

/// Factor graph over a sliding window of states (EV-Pose eq. 6): a prior on the oldest, motion factors
/// between neighbours (eq. 2, 4) and pose measurements (eq. 3). Solved by Gauss-Newton.
///
/// States that leave the window leave a prior on the next one, linearised where that state stood then; its
/// vector is moved along when the state moves, its matrix is not made anew. The map makes every direction
/// observable, so there is no null space that an old linearisation could fill with false information.
class Window {
 public:
  explicit Window(const Eigen::Vector3d& gravity_map) : gravity_map_(gravity_map) {}

  /// The window holds `first` alone, with its covariance as prior; zero variances count as very small.
  void start(const FusionState& first);
  /// A new state, `motion` after the newest. `state` is where it is linearised first; `measurement` is
  /// relative to `measured_at`.
  void add(const Preintegration& motion, const FusionState& state, const PoseInformation& measurement,
           const Pose& measured_at);
  /// Gauss-Newton on all states. False, and nothing changed, if the equations are not positive definite.
  bool optimise(int iterations);
  /// Marginalises all states before `t`; the newest always stays.
  void forget_before(TimeNs t);

  std::size_t size() const { return nodes_.size(); }
  const FusionState& state(std::size_t i) const { return nodes_[i].state; }
  /// The newest state with the covariance of the last optimise().
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

  Eigen::Vector3d gravity_map_;
  std::deque<Node> nodes_;
  FusionState prior_at_;  ///< where the prior is linearised
  Matrix15d prior_information_;
  Vector15d prior_vector_;
  BlockChain chain_;
};

}  // namespace evpose
