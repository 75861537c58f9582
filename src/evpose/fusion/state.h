// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>

#include "evpose/imu/strapdown.h"

namespace evpose {

using Matrix15d = Eigen::Matrix<double, 15, 15>;
using Vector15d = Eigen::Matrix<double, 15, 1>;

/// How the state moves between measurements.
enum class MotionModel { imu, constant_velocity };

/// Where the blocks of a 15-state error begin: (p, phi, v, b_g, b_a), perturbed as Pose::plus.
namespace error_state {
inline constexpr int kP = 0, kPhi = 3, kV = 6, kBg = 9, kBa = 12;
}

/// State of the fusion at one time.
struct FusionState {
  TimeNs t = 0;
  NavState nav;
  Eigen::Vector3d gyro_bias =
      Eigen::Vector3d::Zero();  ///< rad/s; constant velocity: minus the body's angular rate
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();    ///< m/s^2; unused under constant velocity
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();  ///< of the body, rad/s, at the last prediction
  Matrix15d covariance = Matrix15d::Zero();

  Matrix6d pose_covariance() const { return covariance.topLeftCorner<6, 6>(); }

  /// Adds an error; the covariance stays as it is.
  void add(const Vector15d& d);
  /// The error d with other.add(d) == *this.
  Vector15d minus(const FusionState& other) const;
};

/// A pose measurement in information form, linearised at the predicted pose: near it the measurement's cost
/// is d^T information d / 2 - vector^T d, with d as in Pose::plus. The information may be singular.
struct PoseInformation {
  Matrix6d information = Matrix6d::Zero();
  Vector6d vector = Vector6d::Zero();
};

/// The same measurement relative to another pose near by.
PoseInformation moved(const PoseInformation& measurement, const Pose& measured_at, const Pose& to);

/// One contour sample's part of a measurement. Its information, and that of all others of one measurement,
/// is what PoseInformation sums up where it was measured.
struct ContourOffset {
  Eigen::Vector3d point_body;   ///< of the sample, from the pose at which it was measured, m
  Eigen::Vector3d across_body;  ///< distance across the contour in the image by the point, px/m
  double offset_px = 0;         ///< by which the point should move against `across_body`
  double weight = 0;            ///< px^-2
  std::uint32_t segment = 0;    ///< of the map, as the back end has it cut
  double sigma_m = 0;           ///< error of the contour that the map states
  Eigen::Vector2d normal_px =
      Eigen::Vector2d::Zero();  ///< unit, in the image, to where distances are positive
  double speed_px_s = 0;        ///< of the contour along the normal
  int darker = 0;               ///< +1: it is darker where the normal points, -1: brighter, 0: not known
  double concentration = 0;     ///< share of the events in the gates that is of contours; 0: not known
  /// Derivative of an event's signed distance by the numbers of the camera; empty: not asked for.
  Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 9> by_intrinsics{};

  /// Derivative of the distance by the pose at which it was measured, as Pose::plus.
  Vector6d by_pose(const Eigen::Matrix3d& R_map_body) const;
};

/// Normalised innovation squared of a measurement relative to a predicted pose of this covariance, divided by
/// its rank: about 1 when both know how good they are.
double innovation(const Matrix6d& pose_covariance, const PoseInformation& measurement);

}  // namespace evpose
