// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/ekf.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "evpose/core/config.h"
#include "evpose/core/error.h"

namespace evpose {
namespace {

constexpr int kP = 0, kPhi = 3, kV = 6, kBg = 9, kBa = 12;

void symmetrise(Matrix15d& m) { m = (0.5 * (m + m.transpose())).eval(); }

}  // namespace

void describe(ConfigTable& table, EkfConfig& c) {
  table.add("gravity_x", c.gravity_map.x(), "m/s^2", "gravity in the map frame", {-20, 20});
  table.add("gravity_y", c.gravity_map.y(), "m/s^2", "gravity in the map frame", {-20, 20});
  table.add("gravity_z", c.gravity_map.z(), "m/s^2", "gravity in the map frame", {-20, 20});
  table.add("imu_noise_scale", c.imu_noise_scale, "", "factor on the IMU's noise densities", {0.01, 1000});
  table.add("cv_accel_density", c.cv_accel_density, "m/s^2/sqrt(Hz)", "without IMU: white acceleration",
            {1e-6, 1e6});
  table.add("cv_angular_density", c.cv_angular_density, "rad/s^2/sqrt(Hz)",
            "without IMU: white angular acceleration", {1e-6, 1e6});
  table.add("start_position_sigma_m", c.start_position_sigma_m, "m", "error of the start position, 1 sigma",
            {1e-6, 10});
  table.add("start_rotation_sigma_rad", c.start_rotation_sigma_rad, "rad",
            "error of the start attitude, 1 sigma", {1e-6, 1});
  table.add("start_velocity_sigma_m_s", c.start_velocity_sigma_m_s, "m/s",
            "error of the start velocity, 1 sigma", {1e-6, 100});
  table.add("start_gyro_bias_sigma_rad_s", c.start_gyro_bias_sigma_rad_s, "rad/s",
            "gyroscope bias at the start, 1 sigma", {1e-6, 10});
  table.add("start_accel_bias_sigma_m_s2", c.start_accel_bias_sigma_m_s2, "m/s^2",
            "accelerometer bias at the start, 1 sigma", {1e-6, 10});
  table.add("start_angular_rate_sigma_rad_s", c.start_angular_rate_sigma_rad_s, "rad/s",
            "without IMU: error of the start's angular rate, 1 sigma", {1e-6, 10});
}

Ekf::Ekf(MotionModel model, const EkfConfig& config, const ImuNoise& noise)
    : model_(model), config_(config), noise_(noise) {
  if (model_ == MotionModel::constant_velocity) {
    // A gyroscope that reads zero without noise and whose bias walks as the angular rate does; no
    // accelerometer.
    config_.imu_noise_scale = 1;
    noise_.gyro_density = 0;
    noise_.gyro_walk = config_.cv_angular_density;
    noise_.accel_density = config_.cv_accel_density;
    noise_.accel_walk = 0;
    config_.start_gyro_bias_sigma_rad_s = config_.start_angular_rate_sigma_rad_s;
    config_.start_accel_bias_sigma_m_s2 = 0;
  }
}

void Ekf::start(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body) {
  state_ = FusionState{};
  state_.t = t;
  state_.nav = nav;
  angular_rate_ = angular_rate_body;
  if (model_ == MotionModel::constant_velocity) state_.gyro_bias = -angular_rate_body;
  const auto set = [this](int at, double sigma) {
    state_.covariance.diagonal().segment<3>(at).setConstant(sigma * sigma);
  };
  set(kP, config_.start_position_sigma_m);
  set(kPhi, config_.start_rotation_sigma_rad);
  set(kV, config_.start_velocity_sigma_m_s);
  set(kBg, config_.start_gyro_bias_sigma_rad_s);
  set(kBa, config_.start_accel_bias_sigma_m_s2);
}

void Ekf::propagate_covariance(const NavState& before, const Eigen::Vector3d& rate,
                               const Eigen::Vector3d& force, double dt) {
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

  const double scale2 = config_.imu_noise_scale * config_.imu_noise_scale;
  const auto variance = [scale2](double density) { return scale2 * density * density; };
  Matrix15d Q = Matrix15d::Zero();
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const double qa = variance(noise_.accel_density), qg = variance(noise_.gyro_walk);
  Q.block<3, 3>(kV, kV) = qa * dt * I;
  Q.block<3, 3>(kP, kV) = Q.block<3, 3>(kV, kP) = 0.5 * qa * dt * dt * I;
  Q.block<3, 3>(kP, kP) = qa * dt * dt * dt / 3 * I;
  Q.block<3, 3>(kPhi, kPhi) = (variance(noise_.gyro_density) * dt + qg * dt * dt * dt / 3) * I;
  Q.block<3, 3>(kPhi, kBg) = Q.block<3, 3>(kBg, kPhi) = -0.5 * qg * dt * dt * I;
  Q.block<3, 3>(kBg, kBg) = qg * dt * I;
  Q.block<3, 3>(kBa, kBa) = variance(noise_.accel_walk) * dt * I;
  state_.covariance = (F * state_.covariance * F.transpose() + Q).eval();
  symmetrise(state_.covariance);
}

void Ekf::predict(const ImuSample& a, const ImuSample& b) {
  EVPOSE_CHECK(model_ == MotionModel::imu && a.t == state_.t && b.t >= a.t);
  if (b.t == a.t) return;
  const NavState before = state_.nav;
  state_.nav = strapdown(before, a, b, state_.gyro_bias, state_.accel_bias, config_.gravity_map);
  state_.t = b.t;
  propagate_covariance(before, 0.5 * (a.gyro + b.gyro) - state_.gyro_bias,
                       0.5 * (a.accel + b.accel) - state_.accel_bias, to_seconds(b.t - a.t));
  angular_rate_ = b.gyro - state_.gyro_bias;
}

void Ekf::predict(TimeNs t) {
  EVPOSE_CHECK(model_ == MotionModel::constant_velocity && t >= state_.t);
  if (t == state_.t) return;
  const double dt = to_seconds(t - state_.t);
  const NavState before = state_.nav;
  angular_rate_ = -state_.gyro_bias;
  state_.nav.T_map_body.q = (before.T_map_body.q * so3::exp(dt * angular_rate_)).normalized();
  state_.nav.T_map_body.p += dt * before.velocity;
  state_.t = t;
  propagate_covariance(before, angular_rate_, Eigen::Vector3d::Zero(), dt);
}

double Ekf::innovation(const PoseInformation& m) const {
  // z = H^-1 b has covariance P + H^-1, so that NIS = z^T (P + H^-1)^-1 z = b^T (H + H P H)^-1 b on H's
  // range.
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(m.information);
  const double largest = eigen.eigenvalues().maxCoeff();
  if (!(largest > 0)) return 0;
  Matrix6d basis = Matrix6d::Zero();
  int rank = 0;
  for (int i = 0; i < 6; ++i)
    if (eigen.eigenvalues()(i) > 1e-12 * largest) basis.col(rank++) = eigen.eigenvectors().col(i);
  const Eigen::MatrixXd U = basis.leftCols(rank);
  const Matrix6d S = m.information + m.information * state_.pose_covariance() * m.information;
  const Eigen::VectorXd b = U.transpose() * m.vector;
  return b.dot((U.transpose() * S * U).ldlt().solve(b)) / rank;
}

void Ekf::update(const PoseInformation& m) {
  // Kalman update in a form that needs no inverse of the (possibly singular) information H:
  //   dx = P_x (I + H P)^-1 b,   P' = P - P_x (I + H P)^-1 H P_x^T,  P_x the first six columns of P.
  const Matrix6d P = state_.pose_covariance();
  const Eigen::Matrix<double, 15, 6> P_x = state_.covariance.leftCols<6>();
  const Eigen::PartialPivLU<Matrix6d> lu(Matrix6d::Identity() + m.information * P);
  const Vector15d dx = P_x * lu.solve(m.vector);
  state_.covariance -= (P_x * lu.solve(m.information) * P_x.transpose()).eval();
  symmetrise(state_.covariance);
  state_.nav.T_map_body = state_.nav.T_map_body.plus(dx.head<6>());
  state_.nav.velocity += dx.segment<3>(kV);
  state_.gyro_bias += dx.segment<3>(kBg);
  state_.accel_bias += dx.segment<3>(kBa);
  angular_rate_ -= dx.segment<3>(kBg);
  // The attitude error now refers to the corrected body axes.
  Matrix15d G = Matrix15d::Identity();
  G.block<3, 3>(kPhi, kPhi) = so3::right_jacobian(dx.segment<3>(kPhi));
  state_.covariance = (G * state_.covariance * G.transpose()).eval();
  symmetrise(state_.covariance);
}

}  // namespace evpose
