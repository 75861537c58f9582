// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/fusion/state.h"

namespace evpose {

/// Names a block of further states in an ErrorStateFilter, until the block is removed.
enum class BlockId : int {};

/// The error of the pose that is seen is that of the state's pose plus by_block * (error of the block).
struct PoseShift {
  BlockId block;
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6> by_block;
};

/// Derivative of one sample's residual by the error of a block.
struct BlockRow {
  using Derivative = Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 12>;
  BlockId block;
  Derivative by_block;
};

/// One sample's residual r, as far as blocks enter it: it is by_pose * (error of the seen pose) plus the sum
/// of by_block * (error of the block), plus noise of variance 1 / weight.
struct BlockSample {
  Vector6d by_pose;
  double weight = 0;
  double residual = 0;  ///< at the present value of the blocks, as the pose's information vector holds it
  std::span<const BlockRow> rows;
};

/// A pose measurement together with what it says about blocks of further states. It is a quadratic cost
///   y^T information y / 2 - vector^T y
/// of the measured errors y: first the error of the seen pose (6), then those of the blocks that samples
/// depend on. A block may enter in two ways: it shifts the seen pose as a whole (an error of the camera's
/// mounting), or single samples depend on it (an offset of a map segment, an intrinsic parameter).
class JointMeasurement {
 public:
  /// Begins anew with what the registration summed up for the pose, over all samples.
  void start(const PoseInformation& pose, std::span<const PoseShift> shifts = {});
  /// Adds what a sample says about blocks. Its share of the pose's own information and vector is in there
  /// already.
  void add(const BlockSample& sample);

  /// Takes out a sample's share of the pose's own information and vector.
  void withdraw(const Vector6d& by_pose, double weight, double residual);

  /// Adds what is known of blocks together with the pose: information and vector of the pose and of these, in
  /// this order. The pose's own part is in there already.
  struct SizedBlock {
    BlockId id;
    int size;
  };
  void add_blocks(std::span<const SizedBlock> blocks, const Eigen::MatrixXd& information,
                  const Eigen::VectorXd& vector);

  /// Room for this many errors that samples share and that are no states; after start().
  void expect_shared_errors(int count);
  /// By how much a shared error of one sigma moves the sample's residual, px.
  void add_shared_error(int number, double px, const BlockSample& sample);

  struct Block {
    BlockId id;
    int at, size;  ///< among the measured errors
  };
  std::span<const Block> blocks() const { return blocks_; }
  std::span<const PoseShift> shifts() const { return shifts_; }
  int size() const { return size_; }
  auto information() const { return information_.topLeftCorner(size_, size_); }
  auto vector() const { return vector_.head(size_); }
  /// By how much each shared error, of one sigma, moves the vector.
  auto shared_errors() const { return shared_errors_.topRows(size_); }

 private:
  int place_of(BlockId id, int size);

  std::vector<PoseShift> shifts_;
  std::vector<Block> blocks_;
  std::vector<int> place_;  ///< in blocks_, by id; -1: not there
  int size_ = 6;
  // With room to spare, so that they are not made anew with each block; symmetric up to size_.
  Eigen::MatrixXd information_ = Eigen::MatrixXd::Zero(6, 6);
  Eigen::VectorXd vector_ = Eigen::VectorXd::Zero(6);
  Eigen::MatrixXd shared_errors_ = Eigen::MatrixXd::Zero(6, 0);
};

}  // namespace evpose
