// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/ekf.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

void symmetrise(Matrix15d& m) { m = (0.5 * (m + m.transpose())).eval(); }

}  // namespace

void correct(FusionState& state, const PoseInformation& m) {
  // Kalman update in a form that needs no inverse of the (possibly singular) information H:
  //   dx = P_x (I + H P)^-1 b,   P' = P - P_x (I + H P)^-1 H P_x^T,  P_x the first six columns of P.
  const Matrix6d P = state.pose_covariance();
  const Eigen::Matrix<double, 15, 6> P_x = state.covariance.leftCols<6>();
  const Eigen::PartialPivLU<Matrix6d> lu(Matrix6d::Identity() + m.information * P);
  const Vector15d dx = P_x * lu.solve(m.vector);
  state.covariance -= (P_x * lu.solve(m.information) * P_x.transpose()).eval();
  symmetrise(state.covariance);
  state.add(dx);
  // The attitude error now refers to the corrected body axes.
  Matrix15d G = Matrix15d::Identity();
  G.block<3, 3>(error_state::kPhi, error_state::kPhi) = so3::right_jacobian(dx.segment<3>(error_state::kPhi));
  state.covariance = (G * state.covariance * G.transpose()).eval();
  symmetrise(state.covariance);
}

void Ekf::start(const FusionState& first) {
  state_ = first;
  calibration_ = {};
  cross_.setZero();
  spread_.setZero();
  if (config_.time_offset) spread_(0, 0) = config_.start_time_sigma_s * config_.start_time_sigma_s;
  if (config_.rotation)
    spread_.diagonal().tail<3>().setConstant(config_.start_rotation_sigma_rad *
                                             config_.start_rotation_sigma_rad);
  motion_mean_ << first.nav.velocity, first.angular_rate;
  motion_square_ = motion_mean_.cwiseAbs2();
  watched_ = first.t;
}

void Ekf::predict(const ImuSample& a, const ImuSample& b, bool suspect) {
  if (!calibrates()) return motion().step(state_, a, b, suspect);
  Matrix15d F;
  motion().step(state_, a, b, suspect, &F);
  cross_ = (F * cross_).eval();
}

void Ekf::predict(TimeNs t) {
  if (!calibrates()) return motion().step(state_, t);
  Matrix15d F;
  motion().step(state_, t, &F);
  cross_ = (F * cross_).eval();
}

Ekf::ByCalibration Ekf::by_calibration() const {
  ByCalibration G = ByCalibration::Zero();
  if (config_.time_offset) G.col(0) << state_.nav.velocity, state_.angular_rate;
  if (config_.rotation) {
    // The camera's pose is what is seen; the body's follows from it by the given T_body_cam.
    G.block<3, 3>(0, 1) = state_.nav.T_map_body.rotation() * so3::hat(camera_in_body_);
    G.block<3, 3>(3, 1).setIdentity();
  }
  return G;
}

Matrix6d Ekf::measured_covariance() const {
  const Matrix6d P = state_.pose_covariance();
  if (!calibrates()) return P;
  const ByCalibration G = by_calibration();
  const Matrix6d mixed = cross_.topRows<6>() * G.transpose();
  return P + mixed + mixed.transpose() + G * spread_ * G.transpose();
}

void Ekf::watch_motion() {
  constexpr double kOver_s = 0.5;
  const double share = 1 - std::exp(-to_seconds(state_.t - watched_) / kOver_s);
  watched_ = state_.t;
  Vector6d now;
  now << state_.nav.velocity, state_.angular_rate;
  motion_mean_ += share * (now - motion_mean_);
  motion_square_ += share * (now.cwiseAbs2() - motion_square_);
  const Vector6d variance = motion_square_ - motion_mean_.cwiseAbs2();
  const auto below = [](double sum, double least) { return !(sum > least * least); };
  calibration_.frozen = below(variance.head<3>().sum(), config_.least_velocity_m_s) &&
                        below(variance.tail<3>().sum(), config_.least_rate_rad_s);
}

void Ekf::update(const PoseInformation& m) {
  if (!calibrates()) return correct(state_, m);
  watch_motion();
  // As correct(), with z = pose error + G (calibration error).
  const ByCalibration G = by_calibration();
  const Eigen::Matrix<double, 15, 6> P_xz = state_.covariance.leftCols<6>() + cross_ * G.transpose();
  const Eigen::Matrix<double, 4, 6> P_cz = cross_.topRows<6>().transpose() + spread_ * G.transpose();
  const Matrix6d P_zz = P_xz.topRows<6>() + G * P_cz;
  const Eigen::PartialPivLU<Matrix6d> lu(Matrix6d::Identity() + m.information * P_zz);
  const Vector6d weighed = lu.solve(m.vector);
  const Matrix6d gained = lu.solve(m.information);
  const Vector15d dx = P_xz * weighed;
  state_.covariance -= (P_xz * gained * P_xz.transpose()).eval();
  cross_ -= (P_xz * gained * P_cz.transpose()).eval();
  if (!calibration_.frozen) {
    const Eigen::Vector4d dc = P_cz * weighed;
    spread_ -= (P_cz * gained * P_cz.transpose()).eval();
    spread_ = (0.5 * (spread_ + spread_.transpose())).eval();
    calibration_.time_offset_s += dc(0);
    calibration_.turn = (so3::exp(dc.tail<3>()) * calibration_.turn).normalized();
  }
  state_.add(dx);
  Matrix15d turned = Matrix15d::Identity();
  turned.block<3, 3>(error_state::kPhi, error_state::kPhi) =
      so3::right_jacobian(dx.segment<3>(error_state::kPhi));
  state_.covariance = (turned * state_.covariance * turned.transpose()).eval();
  symmetrise(state_.covariance);
  cross_ = (turned * cross_).eval();
}

Calibration Ekf::calibration() const {
  Calibration out = calibration_;
  out.time_sigma_s = std::sqrt(std::max(0.0, spread_(0, 0)));
  out.turn_sigma_rad = spread_.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
  return out;
}

}  // namespace evpose
