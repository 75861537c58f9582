// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/fusion/joint_measurement.h"
#include "evpose/fusion/state.h"
#include "evpose/fusion/state_propagator.h"

namespace evpose {

/// Error-state Kalman filter over a FusionState and blocks of further states, which the caller adds, removes
/// and freezes. The filter holds the joint covariance; what a block's numbers stand for, and their present
/// value, is the caller's: after an update he applies correction() to it. Blocks do not move of themselves.
///
/// A considered block (Schmidt) is not estimated: its uncertainty and its correlation with all else are
/// taken into account, its correction is zero and its covariance stays.
class ErrorStateFilter {
 public:
  using ByState = Eigen::Matrix<double, 15, Eigen::Dynamic>;

  /// A new state, uncorrelated with the blocks; these keep their covariance.
  void reset_state(const FusionState& state);
  const FusionState& state() const { return state_; }

  /// A block of independent states of these standard deviations, correlated with nothing.
  BlockId add_block(const Eigen::VectorXd& sigma);
  /// A block whose errors are those of `size` of the state's, from number `first` on: measured with the pose,
  /// it tells of them. Does not follow them in time.
  BlockId add_copy(int first, int size);
  /// Covariance of two blocks, or of one; both were added or reset just now.
  void set_covariance(BlockId a, BlockId b, const Eigen::MatrixXd& covariance);
  /// As if the block were removed and added anew.
  void reset_block(BlockId id, const Eigen::VectorXd& sigma);
  /// All else stays as it is known.
  void remove_block(BlockId id);
  void set_considered(BlockId id, bool considered);
  /// Number of states in all blocks.
  int block_states() const { return static_cast<int>(blocks_.rows()); }
  Eigen::MatrixXd covariance(BlockId id) const;
  /// Covariance of (p, phi, v, b_g, b_a) and all blocks, these in the order of at().
  Eigen::MatrixXd joint_covariance() const;
  /// Where the block stands among the states of all blocks; changes as blocks are removed.
  int at(BlockId id) const { return slot(id).at; }
  /// What the last update adds to the block's value.
  auto correction(BlockId id) const { return correction_.segment(slot(id).at, slot(id).size); }

  /// As StatePropagator::propagate; correlations with the blocks follow.
  void propagate(const StatePropagator& propagator, const ImuSample& a, const ImuSample& b, ImuTrust trust);
  void propagate(const StatePropagator& propagator, TimeNs t);
  /// The state's error becomes larger by by_block * (error of the block).
  void add_effect(BlockId id, const ByState& by_block);

  /// Kalman update by a measurement relative to the state's pose and the blocks' present values.
  void update(const JointMeasurement& measurement);

  /// Follows this many errors that many measurements share and of which an update knows nothing: it takes
  /// measurements for independent. Until the next reset_state(), and from no effect on.
  void follow_shared_errors(int count);
  /// What they add to the state's covariance, each being as large as the measurements say one sigma is.
  Matrix15d shared_covariance() const { return by_shared_ * by_shared_.transpose(); }

  /// Covariance of the error of the pose that is seen.
  Matrix6d seen_pose_covariance(std::span<const PoseShift> shifts) const;
  /// The same jointly with the velocity and, if given, a block.
  Eigen::MatrixXd seen_covariance(std::span<const PoseShift> shifts, const BlockId* block) const;
  /// Covariance that a pose told by this measurement alone has from the errors of the blocks that its samples
  /// depend on.
  Matrix6d share_of_blocks(const JointMeasurement& measurement) const;

 private:
  struct Slot {
    int at = 0, size = 0;  ///< size 0: free
    bool considered = false;
  };
  const Slot& slot(BlockId id) const;
  void list_considered();
  template <int kMeasured>
  void update_measured(const JointMeasurement& measurement);
  Eigen::MatrixXd measured_by_shared(const JointMeasurement& measurement) const;
  void correct_blocks(const Eigen::Ref<const Eigen::MatrixXd>& P_by,
                      const Eigen::Ref<const Eigen::MatrixXd>& gained_by);

  FusionState state_;
  std::vector<Slot> slots_;                         ///< by id
  std::vector<int> considered_;                     ///< states of considered blocks
  ByState cross_ = ByState(15, 0);                  ///< covariance of the state with the blocks
  Eigen::MatrixXd blocks_ = Eigen::MatrixXd(0, 0);  ///< covariance of the blocks
  Eigen::VectorXd correction_;
  ByState by_shared_ = ByState(15, 0);                        ///< error of the state by each shared error
  Eigen::MatrixXd blocks_by_shared_ = Eigen::MatrixXd(0, 0);  ///< likewise of the blocks
};

}  // namespace evpose
