// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/joint_measurement.h"

#include <algorithm>

#include "evpose/core/error.h"

namespace evpose {

void JointMeasurement::start(const PoseInformation& pose, std::span<const PoseShift> shifts) {
  shifts_.assign(shifts.begin(), shifts.end());
  for (const Block& block : blocks_) place_[static_cast<std::size_t>(block.id)] = -1;
  blocks_.clear();
  size_ = 6;
  information_.topLeftCorner<6, 6>() = pose.information;
  vector_.head<6>() = pose.vector;
  shared_errors_.topRows<6>().setZero();
}

void JointMeasurement::expect_shared_errors(int count) {
  shared_errors_.setZero(shared_errors_.rows(), count);
}

void JointMeasurement::add_shared_error(int number, double px, const BlockSample& s) {
  auto column = shared_errors_.col(number);
  column.head<6>() += s.weight * px * s.by_pose;
  for (const BlockRow& row : s.rows) {
    const auto n = static_cast<int>(row.by_block.size());
    const Block here = blocks_[static_cast<std::size_t>(place_of(row.block, n))];
    column.segment(here.at, n) += s.weight * px * row.by_block.transpose();
  }
}

int JointMeasurement::place_of(BlockId id, int size) {
  const auto number = static_cast<std::size_t>(id);
  if (number >= place_.size()) place_.resize(number + 1, -1);
  if (place_[number] >= 0) return place_[number];
  place_[number] = static_cast<int>(blocks_.size());
  blocks_.push_back({id, size_, size});
  const int first = size_;
  size_ += size;
  if (size_ > information_.rows()) {
    const Eigen::Index room = std::max<Eigen::Index>(size_, 2 * information_.rows());
    information_.conservativeResize(room, room);
    vector_.conservativeResize(room);
    shared_errors_.conservativeResize(room, Eigen::NoChange);
  }
  information_.block(first, 0, size, size_).setZero();
  information_.block(0, first, size_, size).setZero();
  vector_.segment(first, size).setZero();
  shared_errors_.middleRows(first, size).setZero();
  return place_[number];
}

void JointMeasurement::add(const BlockSample& s) {
  for (const BlockRow& row : s.rows) {
    const auto n = static_cast<int>(row.by_block.size());
    const Block here = blocks_[static_cast<std::size_t>(place_of(row.block, n))];
    EVPOSE_CHECK(here.size == n);
    const auto mixed = information_.block(0, here.at, 6, n);
    information_.block(0, here.at, 6, n) = mixed + s.weight * s.by_pose * row.by_block;
    information_.block(here.at, 0, n, 6) = mixed.transpose();
    vector_.segment(here.at, n) += s.weight * s.residual * row.by_block.transpose();
    for (const BlockRow& other : s.rows) {
      const auto m = static_cast<int>(other.by_block.size());
      const Block there = blocks_[static_cast<std::size_t>(place_of(other.block, m))];
      information_.block(here.at, there.at, n, m) += s.weight * row.by_block.transpose() * other.by_block;
    }
  }
}

void JointMeasurement::withdraw(const Vector6d& by_pose, double weight, double residual) {
  information_.topLeftCorner<6, 6>() -= weight * by_pose * by_pose.transpose();
  vector_.head<6>() -= weight * residual * by_pose;
}

void JointMeasurement::add_blocks(std::span<const SizedBlock> blocks, const Eigen::MatrixXd& information,
                                  const Eigen::VectorXd& vector) {
  std::vector<int> place{0, 1, 2, 3, 4, 5};  // of what is told, among the measured errors
  for (const SizedBlock& block : blocks) {
    const Block here = blocks_[static_cast<std::size_t>(place_of(block.id, block.size))];
    for (int i = 0; i < here.size; ++i) place.push_back(here.at + i);
  }
  EVPOSE_CHECK(vector.size() == static_cast<Eigen::Index>(place.size()));
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (i >= 6) vector_(place[i]) += vector(static_cast<Eigen::Index>(i));
    for (std::size_t j = i < 6 ? 6 : 0; j < place.size(); ++j)
      information_(place[i], place[j]) +=
          information(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }
}

}  // namespace evpose
