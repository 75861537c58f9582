// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <string>

#include "evpose/core/pose.h"

namespace evpose {

/// What of the estimate's frame is fitted to the ground truth before errors are taken.
enum class Alignment {
  none,  ///< the map is the frame
  se3,   ///< rotation and translation
  yaw,   ///< rotation about z, and translation
  sim3,  ///< rotation, translation and scale
};
const char* to_string(Alignment alignment);

/// x -> scale * q * x + p: coordinates of the estimate's frame to those of the ground truth.
struct Similarity {
  double scale = 1;
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();

  Pose operator*(const Pose& pose) const { return {q * pose.q, scale * (q * pose.p) + p}; }
  /// Covariance of *this * pose: translation turns and scales with the frame, rotation is the body's own.
  Matrix6d covariance(const Matrix6d& of_pose) const;
};

/// The transform that takes `from` to `to` with the least sum of squared distances (Umeyama). Equal counts.
/// Directions that the points leave open (fewer than three, or on a line) get an arbitrary but fixed
/// rotation.
Similarity align(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to, Alignment kind);

}  // namespace evpose
