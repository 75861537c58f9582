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

/// Continuous-time densities, as in Kalibr's imu.yaml.
struct ImuNoise {
  double accel_density = 2e-3;  ///< m/s^2/sqrt(Hz)
  double accel_walk = 3e-4;     ///< m/s^3/sqrt(Hz)
  double gyro_density = 4e-4;   ///< rad/s/sqrt(Hz)
  double gyro_walk = 2e-5;      ///< rad/s^2/sqrt(Hz)
  double rate_hz = 200;         ///< nominal
};

}  // namespace evpose
