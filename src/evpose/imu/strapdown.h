// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// Sample at a time between two others, linear in rate and specific force.
ImuSample interpolate(const ImuSample& a, const ImuSample& b, TimeNs t);

/// Pose and velocity of the body in the map frame.
struct NavState {
  Pose T_map_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, map frame
};

/// What the IMU says of the time from a to b, in the body frame of a and free of gravity.
struct ImuIncrement {
  double dt_s = 0;
  Eigen::Quaterniond dq = Eigen::Quaterniond::Identity();  ///< R_a_b
  Eigen::Vector3d dv = Eigen::Vector3d::Zero();            ///< integral of R_a_s f(s), m/s
  Eigen::Vector3d dp = Eigen::Vector3d::Zero();            ///< its integral, m
};

/// Rate and specific force are linear between the samples, biases taken off: rotation by the Magnus series
/// with the coning term dt^2 w_a x w_b / 12, velocity and position by Simpson's rule. The error of a step is
/// O(dt^5), beside that of taking the signals as linear.
ImuIncrement integrate(const ImuSample& a, const ImuSample& b, const Eigen::Vector3d& gyro_bias,
                       const Eigen::Vector3d& accel_bias);

/// Of two intervals, b after a.
ImuIncrement joined(const ImuIncrement& a, const ImuIncrement& b);

/// One step from a.t to b.t by integrate() and gravity.
NavState strapdown(const NavState& state, const ImuSample& a, const ImuSample& b,
                   const Eigen::Vector3d& gyro_bias, const Eigen::Vector3d& accel_bias,
                   const Eigen::Vector3d& gravity_map);

}  // namespace evpose
