// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/preintegration.h"

#include <algorithm>

namespace evpose {

using namespace error_state;

Matrix15d process_noise(const ImuNoise& noise, double dt) {
  const auto square = [](double density) { return density * density; };
  const double qa = square(noise.accel_density), qg = square(noise.gyro_walk);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  Matrix15d Q = Matrix15d::Zero();
  Q.block<3, 3>(kV, kV) = qa * dt * I;
  Q.block<3, 3>(kP, kV) = Q.block<3, 3>(kV, kP) = 0.5 * qa * dt * dt * I;
  Q.block<3, 3>(kP, kP) = qa * dt * dt * dt / 3 * I;
  Q.block<3, 3>(kPhi, kPhi) = (square(noise.gyro_density) * dt + qg * dt * dt * dt / 3) * I;
  Q.block<3, 3>(kPhi, kBg) = Q.block<3, 3>(kBg, kPhi) = -0.5 * qg * dt * dt * I;
  Q.block<3, 3>(kBg, kBg) = qg * dt * I;
  Q.block<3, 3>(kBa, kBa) = square(noise.accel_walk) * dt * I;
  return Q;
}

void Preintegration::add(const ImuSample& a, const ImuSample& b, const ImuNoise& noise) {
  if (b.t <= a.t) {
    ++left_out_;
    return;
  }
  const ImuIncrement step = integrate(a, b, gyro_bias_, accel_bias_);
  const double dt = step.dt_s;
  const Eigen::Vector3d rate = 0.5 * (a.gyro + b.gyro) - gyro_bias_;
  const Eigen::Matrix3d R = (sum_.dq * so3::exp(0.5 * dt * rate)).toRotationMatrix();
  const Eigen::Matrix3d force = so3::hat(0.5 * (a.accel + b.accel) - accel_bias_);
  const Eigen::Matrix3d back = step.dq.toRotationMatrix().transpose();
  // The attitude error is in the body of the step's start; that of velocity takes its mean over the step.
  const Eigen::Matrix3d start = sum_.dq.toRotationMatrix();
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();

  Matrix15d F = Matrix15d::Identity();
  F.block<3, 3>(kPhi, kPhi) = back;
  F.block<3, 3>(kPhi, kBg) = -so3::right_jacobian(dt * rate) * dt;
  F.block<3, 3>(kV, kPhi) = -start * so3::hat(step.dv);
  F.block<3, 3>(kV, kBg) = 0.5 * dt * dt * R * force;
  F.block<3, 3>(kV, kBa) = -dt * R;
  F.block<3, 3>(kP, kPhi) = -start * so3::hat(step.dp);
  F.block<3, 3>(kP, kV) = dt * I;
  F.block<3, 3>(kP, kBg) = dt * dt * dt / 6 * R * force;
  F.block<3, 3>(kP, kBa) = -0.5 * dt * dt * R;
  const Matrix15d P = F * covariance_ * F.transpose() + process_noise(noise, dt);
  covariance_ = 0.5 * (P + P.transpose());
  by_bias_ = (F.topLeftCorner<9, 9>() * by_bias_ + F.topRightCorner<9, 6>()).eval();

  sum_.dp += dt * sum_.dv + sum_.dq * step.dp;
  sum_.dv += sum_.dq * step.dv;
  sum_.dq = (sum_.dq * step.dq).normalized();
  sum_.dt_s += dt;
  longest_step_s_ = std::max(longest_step_s_, dt);
}

ImuIncrement Preintegration::corrected(const Eigen::Vector3d& gyro_bias,
                                       const Eigen::Vector3d& accel_bias) const {
  Vector6d change;
  change << gyro_bias - gyro_bias_, accel_bias - accel_bias_;
  const Eigen::Matrix<double, 9, 1> d = by_bias_ * change;
  ImuIncrement out = sum_;
  out.dp += d.segment<3>(kP);
  out.dq = sum_.dq * so3::exp(d.segment<3>(kPhi));
  out.dv += d.segment<3>(kV);
  return out;
}

FusionState Preintegration::predict(const FusionState& start, const Eigen::Vector3d& gravity_map) const {
  const ImuIncrement inc = corrected(start.gyro_bias, start.accel_bias);
  const Eigen::Quaterniond& q = start.nav.T_map_body.q;
  const double dt = inc.dt_s;
  FusionState end = start;
  end.nav.T_map_body.q = (q * inc.dq).normalized();
  end.nav.T_map_body.p += dt * start.nav.velocity + 0.5 * dt * dt * gravity_map + q * inc.dp;
  end.nav.velocity += dt * gravity_map + q * inc.dv;
  return end;
}

Preintegration::Residual Preintegration::residual(const FusionState& i, const FusionState& j,
                                                  const Eigen::Vector3d& gravity_map) const {
  const ImuIncrement inc = corrected(i.gyro_bias, i.accel_bias);
  const double dt = inc.dt_s;
  const Eigen::Matrix3d R_i = i.nav.T_map_body.rotation(), R_j = j.nav.T_map_body.rotation();
  const Eigen::Vector3d moved = R_i.transpose() * (j.nav.T_map_body.p - i.nav.T_map_body.p -
                                                   dt * i.nav.velocity - 0.5 * dt * dt * gravity_map);
  const Eigen::Vector3d gained = R_i.transpose() * (j.nav.velocity - i.nav.velocity - dt * gravity_map);
  const Eigen::Vector3d turned =
      so3::log(inc.dq.conjugate() * i.nav.T_map_body.q.conjugate() * j.nav.T_map_body.q);

  Residual r;
  r.value.segment<3>(kP) = moved - inc.dp;
  r.value.segment<3>(kPhi) = turned;
  r.value.segment<3>(kV) = gained - inc.dv;
  r.value.segment<3>(kBg) = j.gyro_bias - i.gyro_bias;
  r.value.segment<3>(kBa) = j.accel_bias - i.accel_bias;
  r.by_start.setZero();
  r.by_end.setIdentity();
  const Eigen::Matrix3d by_turn = so3::right_jacobian_inverse(turned);
  r.by_start.block<3, 3>(kP, kP) = -R_i.transpose();
  r.by_start.block<3, 3>(kP, kPhi) = so3::hat(moved);
  r.by_start.block<3, 3>(kP, kV) = -dt * R_i.transpose();
  r.by_start.block<3, 3>(kPhi, kPhi) = -by_turn * R_j.transpose() * R_i;
  r.by_start.block<3, 3>(kV, kPhi) = so3::hat(gained);
  r.by_start.block<3, 3>(kV, kV) = -R_i.transpose();
  r.by_start.block<6, 6>(kBg, kBg) = -Matrix6d::Identity();
  r.by_end.block<3, 3>(kP, kP) = R_i.transpose();
  r.by_end.block<3, 3>(kPhi, kPhi) = by_turn;
  r.by_end.block<3, 3>(kV, kV) = R_i.transpose();
  // Biases enter through the corrected increments.
  r.by_start.block<3, 6>(kP, kBg) = -by_bias_.topRows<3>();
  r.by_start.block<3, 6>(kV, kBg) = -by_bias_.bottomRows<3>();
  Vector6d change;
  change << i.gyro_bias - gyro_bias_, i.accel_bias - accel_bias_;
  r.by_start.block<3, 6>(kPhi, kBg) = -so3::right_jacobian_inverse(-turned) *
                                      so3::right_jacobian(by_bias_.middleRows<3>(kPhi) * change) *
                                      by_bias_.middleRows<3>(kPhi);
  return r;
}

}  // namespace evpose
