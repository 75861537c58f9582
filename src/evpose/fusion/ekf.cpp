// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/ekf.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

// Where the slow errors stand: time offset, turn and shift of the camera, tilt of gravity about the map's x
// and y, offset of the measured pose.
constexpr int kTime = 0, kTurn = 1, kShift = 4, kTilt = 7, kOffset = 9;
constexpr int kCalibration = kTilt;  // so many come first

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

Ekf::Ekf(const StatePropagator& propagator, const CalibrationConfig& calibration,
         const SlowErrorsConfig& slow, const Pose& T_body_cam)
    : BackEnd(propagator), config_(calibration), slow_config_(slow), T_body_cam_(T_body_cam) {
  slow_ = config_.time_offset || config_.rotation || config_.translation || slow.gravity || slow.pose_offset;
}

void Ekf::start(const FusionState& first) {
  state_ = first;
  cross_.setZero();
  motion_mean_ << first.nav.velocity, first.angular_rate;
  motion_square_ = motion_mean_.cwiseAbs2();
  watched_ = first.t;
  if (started_) {
    // The pose was seen anew by the camera: the body's is as wrong as the calibration, against it.
    const BySlow G = by_slow();
    state_.covariance.topLeftCorner<6, 6>() += G * spread_ * G.transpose();
    cross_.topRows<6>() = -G * spread_;
    return;
  }
  started_ = true;
  Vector15d sigma = Vector15d::Zero();
  if (config_.time_offset) sigma(kTime) = config_.start_time_sigma_s;
  if (config_.rotation) sigma.segment<3>(kTurn).setConstant(config_.start_rotation_sigma_rad);
  if (config_.translation) sigma.segment<3>(kShift).setConstant(config_.start_translation_sigma_m);
  if (slow_config_.gravity) sigma.segment<2>(kTilt).setConstant(slow_config_.gravity_sigma_rad);
  if (slow_config_.pose_offset) {
    sigma.segment<3>(kOffset).setConstant(slow_config_.offset_position_sigma_m);
    sigma.segment<3>(kOffset + 3).setConstant(slow_config_.offset_rotation_sigma_rad);
  }
  spread_ = sigma.cwiseAbs2().asDiagonal();
}

void Ekf::predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) {
  if (!slow_) return propagator().propagate(state_, a, b, trust);
  Matrix15d F;
  propagator().propagate(state_, a, b, trust, &F);
  carry(F, to_seconds(b.t - a.t));
}

void Ekf::predict(TimeNs t) {
  if (!slow_) return propagator().propagate(state_, t);
  Matrix15d F;
  const double dt_s = to_seconds(t - state_.t);
  propagator().propagate(state_, t, &F);
  carry(F, dt_s);
}

/// What one step does to the slow errors and to what they have in common with the state.
void Ekf::carry(const Matrix15d& F, double dt) {
  cross_ = (F * cross_).eval();
  if (slow_config_.gravity) {
    Matrix15d pushed = Matrix15d::Zero();  // the state by the slow errors
    const Eigen::Matrix3d by_turn = -so3::hat(propagator().gravity_map());
    pushed.block<3, 2>(error_state::kV, kTilt) = dt * by_turn.leftCols<2>();
    pushed.block<3, 2>(error_state::kP, kTilt) = 0.5 * dt * dt * by_turn.leftCols<2>();
    const Matrix15d mixed = cross_ * pushed.transpose();
    state_.covariance += mixed + mixed.transpose() + pushed * spread_ * pushed.transpose();
    cross_ += pushed * spread_;
  }
  if (!slow_config_.pose_offset) return;
  // A first-order Gauss-Markov process.
  const double keep = std::exp(-dt / slow_config_.offset_s);
  offset_ *= keep;
  cross_.rightCols<6>() *= keep;
  spread_.rightCols<6>() *= keep;
  spread_.bottomRows<6>() *= keep;
  const auto add = [&](int at, double sigma) {
    spread_.diagonal().segment<3>(at).array() += (1 - keep * keep) * sigma * sigma;
  };
  add(kOffset, slow_config_.offset_position_sigma_m);
  add(kOffset + 3, slow_config_.offset_rotation_sigma_rad);
}

Ekf::BySlow Ekf::by_slow() const {
  BySlow G = BySlow::Zero();
  const Eigen::Matrix3d R = state_.nav.T_map_body.rotation();
  if (config_.time_offset) G.col(kTime) << state_.nav.velocity, state_.angular_rate;
  // The camera's pose is what is seen; the body's follows from it by the given T_body_cam.
  if (config_.rotation) {
    G.block<3, 3>(0, kTurn) = R * so3::hat(T_body_cam_.p + calibration_.shift);
    G.block<3, 3>(3, kTurn).setIdentity();
  }
  if (config_.translation) G.block<3, 3>(0, kShift) = R;
  if (slow_config_.pose_offset) G.rightCols<6>().setIdentity();
  return G;
}

Matrix6d Ekf::measured_covariance() const {
  Matrix6d P = state_.pose_covariance();
  if (!slow_) return P;
  const BySlow G = by_slow();
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

void Ekf::apply(const Vector15d& d) {
  calibration_.time_offset_s += d(kTime);
  calibration_.turn = (so3::exp(d.segment<3>(kTurn)) * calibration_.turn).normalized();
  calibration_.shift += d.segment<3>(kShift);
  offset_ += d.tail<6>();
  if (!slow_config_.gravity) return;
  calibration_.gravity_tilt_rad += d.segment<2>(kTilt);
  const Eigen::Vector3d turn(d(kTilt), d(kTilt + 1), 0);
  set_gravity_map(so3::exp(turn) * propagator().gravity_map());
}

void Ekf::update(const PoseInformation& measurement, std::span<const ContourOffset>) {
  if (!slow_) return correct(state_, measurement);
  watch_motion();
  // As correct(), with z = pose error + G (slow errors); what is known of the lasting offset is taken off.
  const PoseInformation m{measurement.information, measurement.vector - measurement.information * offset_};
  const BySlow G = by_slow();
  const Eigen::Matrix<double, 15, 6> P_xz = state_.covariance.leftCols<6>() + cross_ * G.transpose();
  Eigen::Matrix<double, 15, 6> P_cz = cross_.topRows<6>().transpose() + spread_ * G.transpose();
  const Matrix6d P_zz = P_xz.topRows<6>() + G * P_cz;
  const Eigen::PartialPivLU<Matrix6d> lu(Matrix6d::Identity() + m.information * P_zz);
  const Vector6d weighed = lu.solve(m.vector);
  const Matrix6d gained = lu.solve(m.information);
  const Vector15d dx = P_xz * weighed;
  state_.covariance -= (P_xz * gained * P_xz.transpose()).eval();
  cross_ -= (P_xz * gained * P_cz.transpose()).eval();
  Matrix15d learnt = P_cz * gained * P_cz.transpose();
  if (calibration_.frozen) {
    learnt.topLeftCorner<kCalibration, kCalibration>().setZero();
    P_cz.topRows<kCalibration>().setZero();
  }
  spread_ -= learnt;
  symmetrise(spread_);
  apply(P_cz * weighed);
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
  const Vector15d sigma = spread_.diagonal().cwiseMax(0).cwiseSqrt();
  out.time_sigma_s = sigma(kTime);
  out.turn_sigma_rad = sigma.segment<3>(kTurn);
  out.shift_sigma_m = sigma.segment<3>(kShift);
  out.gravity_sigma_rad = sigma.segment<2>(kTilt);
  return out;
}

}  // namespace evpose
