// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/state_propagator.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"
#include "evpose/fusion/back_end.h"
#include "evpose/fusion/preintegration.h"

namespace evpose {

using namespace error_state;

namespace {

/// How long a vehicle keeps one and the same motion, on which faults of the IMU's scale act.
constexpr double kOneMotion_s = 0.3;
/// White angular rate of a vehicle that nobody measures, rad/s/sqrt(Hz): its attitude drifts by 0.6 deg in 10
/// ms.
constexpr double kUnmeasuredGyroDensity = 0.1;

}  // namespace

StatePropagator::StatePropagator(MotionModel model, const FusionConfig& c, const ImuNoise& noise)
    : model_(model), gravity_map_(c.gravity_map), noise_(noise), scale_sigma_(c.imu_scale_sigma) {
  double gyro_sigma = c.start_gyro_bias_sigma_rad_s, accel_sigma = c.start_accel_bias_sigma_m_s2;
  if (model_ == MotionModel::imu) {
    for (double* density :
         {&noise_.accel_density, &noise_.accel_walk, &noise_.gyro_density, &noise_.gyro_walk})
      *density *= c.imu_noise_scale;
  } else {
    // A gyroscope that reads zero without noise and whose bias walks as the angular rate does; no
    // accelerometer.
    noise_.gyro_density = 0;
    noise_.gyro_walk = c.cv_angular_density;
    noise_.accel_density = c.cv_accel_density;
    noise_.accel_walk = 0;
    gravity_map_.setZero();
    gyro_sigma = c.start_angular_rate_sigma_rad_s;
    accel_sigma = 0;
  }
  suspect_noise_ = noise_;
  suspect_noise_.accel_density = std::max(noise_.accel_density, c.cv_accel_density);
  suspect_noise_.gyro_density = std::max(noise_.gyro_density, kUnmeasuredGyroDensity);
  blind_noise_ = suspect_noise_;
  blind_noise_.gyro_walk = std::max(noise_.gyro_walk, c.cv_angular_density);
  start_sigma_.segment<3>(kP).setConstant(c.start_position_sigma_m);
  start_sigma_.segment<3>(kPhi).setConstant(c.start_rotation_sigma_rad);
  start_sigma_.segment<3>(kV).setConstant(c.start_velocity_sigma_m_s);
  start_sigma_.segment<3>(kBg).setConstant(gyro_sigma);
  start_sigma_.segment<3>(kBa).setConstant(accel_sigma);
}

ImuNoise StatePropagator::noise_at(const Eigen::Vector3d& rate, const Eigen::Vector3d& force,
                                   ImuTrust trust) const {
  ImuNoise out = noise(trust);
  if (model_ != MotionModel::imu) return out;
  // As white noise of the strength that an error which lasts so long has at low frequencies.
  const double factor = scale_sigma_ * std::sqrt(2 * kOneMotion_s);
  out.gyro_density = std::hypot(out.gyro_density, factor * rate.norm());
  out.accel_density = std::hypot(out.accel_density, factor * (force.norm() - gravity_map_.norm()));
  return out;
}

FusionState StatePropagator::initial_state(TimeNs t, const NavState& nav,
                                           const Eigen::Vector3d& angular_rate_body) const {
  FusionState state;
  state.t = t;
  state.nav = nav;
  state.angular_rate = angular_rate_body;
  if (model_ == MotionModel::constant_velocity) state.gyro_bias = -angular_rate_body;
  state.covariance.diagonal() = start_sigma_.cwiseAbs2();
  return state;
}

void StatePropagator::propagate_covariance(FusionState& state, const NavState& before,
                                           const Eigen::Vector3d& rate, const Eigen::Vector3d& force,
                                           double dt, ImuTrust trust, Matrix15d* transition) const {
  const Eigen::Quaterniond q_mid = before.T_map_body.q * so3::exp(0.5 * dt * rate);
  const Eigen::Matrix3d R = q_mid.toRotationMatrix();
  // The attitude error is in the body of the step's start; seen from its middle it has turned half the way.
  const Eigen::Matrix3d half_turn = so3::exp(-0.5 * dt * rate).toRotationMatrix();
  const Eigen::Matrix3d dv_dphi = -R * so3::hat(force) * half_turn * dt;

  Matrix15d F = Matrix15d::Identity();
  F.block<3, 3>(kPhi, kPhi) = so3::exp(-dt * rate).toRotationMatrix();
  F.block<3, 3>(kPhi, kBg) = -so3::right_jacobian(dt * rate) * dt;
  F.block<3, 3>(kP, kV) = dt * Eigen::Matrix3d::Identity();
  if (model_ == MotionModel::imu) {
    F.block<3, 3>(kV, kPhi) = dv_dphi;
    F.block<3, 3>(kV, kBa) = -dt * R;
    F.block<3, 3>(kP, kPhi) = 0.5 * dt * dv_dphi;
    F.block<3, 3>(kP, kBa) = -0.5 * dt * dt * R;
  }

  const Matrix15d P = F * state.covariance * F.transpose() + process_noise(noise_at(rate, force, trust), dt);
  state.covariance = 0.5 * (P + P.transpose());
  if (transition != nullptr) *transition = F;
}

void StatePropagator::propagate(FusionState& state, const ImuSample& a, const ImuSample& b, ImuTrust trust,
                                Matrix15d* transition) const {
  if (transition != nullptr) transition->setIdentity();
  EVPOSE_CHECK(model_ == MotionModel::imu && a.t == state.t && b.t >= a.t);
  if (b.t == a.t) return;
  const NavState before = state.nav;
  state.nav = strapdown(before, a, b, state.gyro_bias, state.accel_bias, gravity_map_);
  state.t = b.t;
  propagate_covariance(state, before, 0.5 * (a.gyro + b.gyro) - state.gyro_bias,
                       0.5 * (a.accel + b.accel) - state.accel_bias, to_seconds(b.t - a.t), trust,
                       transition);
  state.angular_rate = b.gyro - state.gyro_bias;
}

void StatePropagator::propagate(FusionState& state, TimeNs t, Matrix15d* transition) const {
  if (transition != nullptr) transition->setIdentity();
  EVPOSE_CHECK(model_ == MotionModel::constant_velocity && t >= state.t);
  if (t == state.t) return;
  const double dt = to_seconds(t - state.t);
  const NavState before = state.nav;
  state.angular_rate = -state.gyro_bias;
  state.nav.T_map_body.q = (before.T_map_body.q * so3::exp(dt * state.angular_rate)).normalized();
  state.nav.T_map_body.p += dt * before.velocity;
  state.t = t;
  propagate_covariance(state, before, state.angular_rate, Eigen::Vector3d::Zero(), dt, ImuTrust::good,
                       transition);
}

}  // namespace evpose
