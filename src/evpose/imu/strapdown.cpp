// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/imu/strapdown.h"

namespace evpose {

ImuSample interpolate(const ImuSample& a, const ImuSample& b, TimeNs t) {
  if (b.t == a.t) return a;
  const double u = static_cast<double>(t - a.t) / static_cast<double>(b.t - a.t);
  return {t, (1 - u) * a.gyro + u * b.gyro, (1 - u) * a.accel + u * b.accel};
}

NavState strapdown(const NavState& state, const ImuSample& a, const ImuSample& b,
                   const Eigen::Vector3d& gyro_bias, const Eigen::Vector3d& accel_bias,
                   const Eigen::Vector3d& gravity_map) {
  const double dt = to_seconds(b.t - a.t);
  const Eigen::Vector3d rate = 0.5 * (a.gyro + b.gyro) - gyro_bias;
  const Eigen::Vector3d force = 0.5 * (a.accel + b.accel) - accel_bias;
  const Eigen::Quaterniond q_mid = state.T_map_body.q * so3::exp(0.5 * dt * rate);
  const Eigen::Vector3d acceleration = q_mid * force + gravity_map;
  NavState out;
  out.T_map_body.q = (state.T_map_body.q * so3::exp(dt * rate)).normalized();
  out.velocity = state.velocity + dt * acceleration;
  out.T_map_body.p = state.T_map_body.p + dt * state.velocity + 0.5 * dt * dt * acceleration;
  return out;
}

}  // namespace evpose
