// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/calibration_states.h"

#include <cmath>
#include <utility>

namespace evpose {
namespace {

/// Without changes of velocity and of angular rate beyond these, over half a second, every error of the
/// calibration is the same as one of the pose.
constexpr double kLeastVelocity_m_s = 0.05, kLeastRate_rad_s = 0.05, kExcitation_s = 0.5;
/// What changes of the angular rate faster than this is vibration. A pixel answers to it late, and by
/// crossings back and forth, so that it tells of the time offset to no more than this.
constexpr double kVibration_s = 0.03, kVibrationSigma_s = 2e-3;

}  // namespace

Vector6d seen_pose_by_time_offset(const FusionState& state) {
  Vector6d out;
  out << state.nav.velocity, state.angular_rate;
  return out;
}

/// The camera's pose is what is seen; the body's follows from it by the given T_body_cam.
Eigen::Matrix<double, 6, 3> seen_pose_by_rotation(const FusionState& state,
                                                  const Eigen::Vector3d& p_body_cam) {
  Eigen::Matrix<double, 6, 3> out;
  out << state.nav.T_map_body.rotation() * so3::hat(p_body_cam), Eigen::Matrix3d::Identity();
  return out;
}

Eigen::Matrix<double, 6, 3> seen_pose_by_translation(const FusionState& state) {
  Eigen::Matrix<double, 6, 3> out;
  out << state.nav.T_map_body.rotation(), Eigen::Matrix3d::Zero();
  return out;
}

Eigen::Matrix<double, 3, 2> tilt_axes(const Eigen::Vector3d& gravity_map) {
  Eigen::Index up = 0;
  gravity_map.cwiseAbs().maxCoeff(&up);
  Eigen::Matrix<double, 3, 2> out;
  out << Eigen::Vector3d::Unit(up == 0 ? 1 : 0), Eigen::Vector3d::Unit(up == 2 ? 1 : 2);
  return out;
}

Eigen::Matrix<double, 15, 2> state_by_gravity_tilt(const Eigen::Vector3d& gravity_map, double dt_s) {
  const Eigen::Matrix<double, 3, 2> by_tilt = -so3::hat(gravity_map) * tilt_axes(gravity_map);
  Eigen::Matrix<double, 15, 2> out = Eigen::Matrix<double, 15, 2>::Zero();
  out.middleRows<3>(error_state::kV) = dt_s * by_tilt;
  out.middleRows<3>(error_state::kP) = 0.5 * dt_s * dt_s * by_tilt;
  return out;
}

CalibrationStates::CalibrationStates(const CalibrationConfig& config, const Pose& T_body_cam)
    : config_(config), T_body_cam_(T_body_cam) {}

void CalibrationStates::start(ErrorStateFilter& filter) {
  const FusionState& state = filter.state();
  motion_mean_.head<3>() = state.nav.velocity;
  motion_mean_.tail<3>() = state.angular_rate;
  motion_square_ = motion_mean_.cwiseAbs2();
  rate_mean_ = rate_mean_of_mean_ = state.angular_rate;
  judged_ = state.t;
  if (started_) {
    for (const PoseShift& shift : pose_shifts(state)) {
      ErrorStateFilter::ByState by_block = ErrorStateFilter::ByState::Zero(15, shift.by_block.cols());
      by_block.topRows<6>() = -shift.by_block;
      filter.add_effect(shift.block, by_block);
    }
    return;
  }
  started_ = true;
  const auto add = [&](bool asked, const Eigen::VectorXd& sigma) -> std::optional<BlockId> {
    if (!asked || !(sigma.array() > 0).any()) return std::nullopt;
    return filter.add_block(sigma);
  };
  time_ = add(config_.time_offset, Eigen::VectorXd::Constant(1, config_.start_time_sigma_s));
  rotation_ = add(config_.rotation, config_.start_rotation_sigma_rad);
  translation_ = add(config_.translation, config_.start_translation_sigma_m);
  gravity_ = add(config_.gravity, Eigen::VectorXd::Constant(2, config_.start_gravity_sigma_rad));
  intrinsics_ = add(config_.intrinsics, config_.start_intrinsics_sigma);
  if (intrinsics_) found_.intrinsics.setZero(config_.start_intrinsics_sigma.size());
  if (time_) {
    vibration_ = filter.add_block(Eigen::VectorXd::Constant(1, kVibrationSigma_s));
    filter.set_considered(*vibration_, true);
  }
  correlate(filter);
  state_sigmas(filter);
}

/// As the calibration's file states it.
void CalibrationStates::correlate(ErrorStateFilter& filter) const {
  if (config_.start_correlation.size() == 0) return;
  using Kind = CalibrationConfig::Kind;
  const std::pair<Kind, std::optional<BlockId>> blocks[] = {{Kind::intrinsics, intrinsics_},
                                                            {Kind::rotation, rotation_},
                                                            {Kind::translation, translation_},
                                                            {Kind::time, time_}};
  for (const auto& [kind, block] : blocks)
    for (const auto& [other_kind, other] : blocks)
      if (block && other && kind <= other_kind)
        filter.set_covariance(*block, *other, config_.start_covariance(kind, other_kind));
}

void CalibrationStates::propagate(ErrorStateFilter& filter, const Eigen::Vector3d& gravity_map,
                                  double dt_s) const {
  if (!gravity_) return;
  filter.add_effect(*gravity_, state_by_gravity_tilt(gravity_map, dt_s));
}

void CalibrationStates::judge_excitation(ErrorStateFilter& filter) {
  const FusionState& state = filter.state();
  const double share = 1 - std::exp(-to_seconds(state.t - judged_) / kExcitation_s);
  const double slow = 1 - std::exp(-to_seconds(state.t - judged_) / kVibration_s);
  rate_mean_ += slow * (state.angular_rate - rate_mean_);
  rate_mean_of_mean_ += slow * (rate_mean_ - rate_mean_of_mean_);
  judged_ = state.t;
  Vector6d now;
  now.head<3>() = state.nav.velocity;
  now.tail<3>() = state.angular_rate;
  motion_mean_ += share * (now - motion_mean_);
  motion_square_ += share * (now.cwiseAbs2() - motion_square_);
  const Vector6d variance = motion_square_ - motion_mean_.cwiseAbs2();
  const auto below = [](double sum, double least) { return !(sum > least * least); };
  found_.frozen = below(variance.head<3>().sum(), kLeastVelocity_m_s) &&
                  below(variance.tail<3>().sum(), kLeastRate_rad_s);
  for (const auto& block : {time_, rotation_, translation_})
    if (block) filter.set_considered(*block, found_.frozen);
}

std::vector<PoseShift> CalibrationStates::pose_shifts(const FusionState& state) const {
  std::vector<PoseShift> shifts;
  if (time_) shifts.push_back({*time_, seen_pose_by_time_offset(state)});
  if (rotation_) shifts.push_back({*rotation_, seen_pose_by_rotation(state, T_body_cam_.p + found_.shift)});
  if (translation_) shifts.push_back({*translation_, seen_pose_by_translation(state)});
  if (vibration_) {
    Vector6d vibration = Vector6d::Zero();
    vibration.tail<3>() = state.angular_rate - (2 * rate_mean_ - rate_mean_of_mean_);
    shifts.push_back({*vibration_, vibration});
  }
  return shifts;
}

std::optional<BlockRow> CalibrationStates::row_of(const ContourOffset& contour) const {
  if (!intrinsics_ || contour.by_intrinsics.size() != found_.intrinsics.size()) return std::nullopt;
  return BlockRow{*intrinsics_, contour.by_intrinsics};
}

void CalibrationStates::apply_corrections(const ErrorStateFilter& filter, Eigen::Vector3d* gravity_map) {
  if (time_) found_.time_offset_s += filter.correction(*time_)(0);
  if (rotation_) {
    const Eigen::Vector3d turn = filter.correction(*rotation_);
    found_.turn = (so3::exp(turn) * found_.turn).normalized();
  }
  if (translation_) found_.shift += filter.correction(*translation_);
  if (intrinsics_) found_.intrinsics += filter.correction(*intrinsics_);
  if (gravity_) {
    const Eigen::Vector2d tilt = filter.correction(*gravity_);
    found_.gravity_tilt_rad += tilt;
    *gravity_map = so3::exp(tilt_axes(*gravity_map) * tilt) * *gravity_map;
  }
  state_sigmas(filter);
}

void CalibrationStates::state_sigmas(const ErrorStateFilter& filter) {
  const auto sigma = [&](BlockId block) -> Eigen::VectorXd {
    return filter.covariance(block).diagonal().cwiseMax(0).cwiseSqrt();
  };
  if (time_) found_.time_sigma_s = sigma(*time_)(0);
  if (rotation_) found_.turn_sigma_rad = sigma(*rotation_);
  if (translation_) found_.shift_sigma_m = sigma(*translation_);
  if (gravity_) found_.gravity_sigma_rad = sigma(*gravity_);
  if (intrinsics_) found_.intrinsics_sigma = sigma(*intrinsics_);
}

}  // namespace evpose
