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

/// One step from a.t to b.t with the means of the two samples, biases taken off:
///   R' = R Exp(w dt),  v' = v + (R_mid f + g) dt,  p' = p + v dt + (R_mid f + g) dt^2 / 2,
/// R_mid = R Exp(w dt / 2). Error per step O(dt^3).
NavState strapdown(const NavState& state, const ImuSample& a, const ImuSample& b,
                   const Eigen::Vector3d& gyro_bias, const Eigen::Vector3d& accel_bias,
                   const Eigen::Vector3d& gravity_map);

}  // namespace evpose
