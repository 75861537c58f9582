// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/imu/imu.h"
#include "evpose/sim/trajectory.h"

namespace evpose::sim {

/// Gravity in the map frame, m/s^2.
inline Eigen::Vector3d gravity_map() { return {0, 0, -9.81}; }

/// What a faultless IMU reads.
ImuSample ideal_imu(const Motion& motion, TimeNs t);

struct ImuErrors {
  double gyro_bias = 0.01;   ///< rad/s, 1 sigma of each axis at the start
  double accel_bias = 0.05;  ///< m/s^2, 1 sigma of each axis at the start
};

/// Samples at noise.rate_hz from time 0 to `duration` inclusive: white noise of density * sqrt(rate), biases
/// that walk from random starts.
std::vector<ImuSample> simulate_imu(const Trajectory& trajectory, TimeNs duration, const ImuNoise& noise,
                                    const ImuErrors& errors, std::uint64_t seed);

}  // namespace evpose::sim
