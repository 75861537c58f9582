// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "evpose/camera/camera.h"

namespace evpose {

/// How wrong a calibration may be, 1 sigma: what its file states. Zero: known. Unset: that of an ordinary
/// calibration of an event camera.
struct CalibrationSigma {
  std::optional<std::vector<double>> intrinsics;  ///< of fx, fy, cx, cy, px
  std::optional<std::vector<double>> distortion;  ///< as CameraIntrinsics::distortion
  std::optional<Eigen::Vector3d> rotation_rad;    ///< of the camera in the body, about the body's axes
  std::optional<Eigen::Vector3d> translation_m;   ///< of the camera in the body, along the body's axes
  std::optional<double> time_s;                   ///< of the IMU's clock against the camera's
  /// Correlation of these errors, in the order above: n intrinsics with distortion, then 3 + 3 + 1; without
  /// an IMU n alone. Unset: they are independent, but for the focal lengths, whose ratio is known to 0.1 %.
  std::optional<Eigen::MatrixXd> correlation;

  /// All zero.
  static CalibrationSigma known(const CameraIntrinsics& camera);

  /// In the order of AdjustedCamera. Without a statement: focal length 0.3 %, centre 1 px, k1 0.01, further
  /// ones 0.02, p1 and p2 0.0005.
  Eigen::VectorXd of_intrinsics(const CameraIntrinsics& camera) const;
  /// (n + 7) x (n + 7).
  Eigen::MatrixXd of_correlation(const CameraIntrinsics& camera) const;
  Eigen::Vector3d of_rotation_rad() const { return rotation_rad.value_or(Eigen::Vector3d::Constant(5e-3)); }
  Eigen::Vector3d of_translation_m() const { return translation_m.value_or(Eigen::Vector3d::Constant(0.01)); }
  double of_time_s() const { return time_s.value_or(2e-3); }
};

}  // namespace evpose
