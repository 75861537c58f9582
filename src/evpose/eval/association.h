// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "evpose/core/pose.h"

namespace evpose {

enum class AssociationRule {
  interpolate,  ///< ground truth interpolated to the estimate's time, inside gaps of at most max_gap_s
  nearest,      ///< the ground-truth pose nearest in time, at most max_difference_s away
};

struct AssociationOptions {
  AssociationRule rule = AssociationRule::interpolate;
  double max_gap_s = 0.05;
  double max_difference_s = 0.01;
};

/// An estimated pose and the true one that it is measured against.
struct PosePair {
  std::size_t index = 0;  ///< of the estimate
  TimeNs t = 0;           ///< of the estimate
  Pose estimate;
  Pose truth;
  /// Slope of the ground truth around t, its frame, m/s.
  Eigen::Vector3d true_velocity = Eigen::Vector3d::Zero();
};

/// Pairs in order of time; estimates without a partner are left out. Both trajectories in order of time; of
/// poses with equal stamps the first counts.
std::vector<PosePair> associate(std::span<const TimedPose> estimate, std::span<const TimedPose> truth,
                                const AssociationOptions& options);

}  // namespace evpose
