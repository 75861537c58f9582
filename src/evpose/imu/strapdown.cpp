// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/imu/strapdown.h"

namespace evpose {

ImuSample interpolate(const ImuSample& a, const ImuSample& b, TimeNs t) {
  if (b.t == a.t) return a;
  const double u = static_cast<double>(t - a.t) / static_cast<double>(b.t - a.t);
  return {t, (1 - u) * a.gyro + u * b.gyro, (1 - u) * a.accel + u * b.accel};
}

ImuIncrement integrate(const ImuSample& a, const ImuSample& b, const Eigen::Vector3d& gyro_bias,
                       const Eigen::Vector3d& accel_bias) {
  const double dt = to_seconds(b.t - a.t);
  const Eigen::Vector3d w0 = a.gyro - gyro_bias, w1 = b.gyro - gyro_bias, w_mid = 0.5 * (w0 + w1);
  const Eigen::Vector3d f0 = a.accel - accel_bias, f1 = b.accel - accel_bias, f_mid = 0.5 * (f0 + f1);
  const Eigen::Quaterniond to_mid = so3::exp(0.25 * dt * (w0 + w_mid) + dt * dt / 48 * w0.cross(w_mid));
  ImuIncrement out;
  out.dt_s = dt;
  out.dq = so3::exp(dt * w_mid + dt * dt / 12 * w0.cross(w1));
  const Eigen::Vector3d force_mid = to_mid * f_mid;
  out.dv = dt / 6 * (f0 + 4 * force_mid + out.dq * f1);
  out.dp = dt * dt / 6 * (f0 + 2 * force_mid);
  return out;
}

ImuIncrement joined(const ImuIncrement& a, const ImuIncrement& b) {
  return {a.dt_s + b.dt_s, (a.dq * b.dq).normalized(), a.dv + a.dq * b.dv,
          a.dp + a.dv * b.dt_s + a.dq * b.dp};
}

NavState strapdown(const NavState& state, const ImuSample& a, const ImuSample& b,
                   const Eigen::Vector3d& gyro_bias, const Eigen::Vector3d& accel_bias,
                   const Eigen::Vector3d& gravity_map) {
  const ImuIncrement step = integrate(a, b, gyro_bias, accel_bias);
  const Eigen::Quaterniond& q = state.T_map_body.q;
  const double dt = step.dt_s;
  NavState out;
  out.T_map_body.q = (q * step.dq).normalized();
  out.velocity = state.velocity + q * step.dv + dt * gravity_map;
  out.T_map_body.p = state.T_map_body.p + dt * state.velocity + q * step.dp + 0.5 * dt * dt * gravity_map;
  return out;
}

}  // namespace evpose
