// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/core/time.h"

namespace evpose {

/// One reading, in the body frame (the IMU's own axes).
struct ImuSample {
  TimeNs t = 0;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();  ///< angular rate, rad/s
  Eigen::Vector3d accel =
      Eigen::Vector3d::Zero();  ///< specific force R^T (a - g), m/s^2; (0, 0, 9.81) at rest, z up
};

/// Scale and misalignment, Kalibr's model scale-misalignment: at the angular rate w and the specific force f
/// of the body a gyroscope reads `gyro` w + `gyro_by_force` f, an accelerometer `accel` f, and bias and
/// noise.
struct ImuAxes {
  Eigen::Matrix3d gyro = Eigen::Matrix3d::Identity();           ///< Kalibr's M C_gyro_i
  Eigen::Matrix3d accel = Eigen::Matrix3d::Identity();          ///< Kalibr's M
  Eigen::Matrix3d gyro_by_force = Eigen::Matrix3d::Zero();      ///< Kalibr's A C_gyro_i, rad/s per m/s^2
  Eigen::Matrix3d gyro_sigma = Eigen::Matrix3d::Constant(-1);   ///< 1 sigma of each element; < 0: not stated
  Eigen::Matrix3d accel_sigma = Eigen::Matrix3d::Constant(-1);  ///< likewise

  bool are_ideal() const { return gyro.isIdentity(0) && accel.isIdentity(0) && gyro_by_force.isZero(0); }
  /// What ideal axes would have read, but for the biases. Both matrices must have inverses.
  ImuSample corrected(const ImuSample& reading) const;
};

/// Continuous-time densities, as in Kalibr's imu.yaml, and the axes that they are told in.
struct ImuNoise {
  double accel_density = 2e-3;  ///< m/s^2/sqrt(Hz)
  double accel_walk = 3e-4;     ///< m/s^3/sqrt(Hz)
  double gyro_density = 4e-4;   ///< rad/s/sqrt(Hz)
  double gyro_walk = 2e-5;      ///< rad/s^2/sqrt(Hz)
  double rate_hz = 200;         ///< nominal
  ImuAxes axes;
};

}  // namespace evpose
