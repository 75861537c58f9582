// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/error_state_filter.h"

namespace evpose {

/// What errors of the calibration do to the pose that is seen (6) and to the state.
Vector6d seen_pose_by_time_offset(const FusionState& state);
/// `p_body_cam`: the camera's place, m.
Eigen::Matrix<double, 6, 3> seen_pose_by_rotation(const FusionState& state,
                                                  const Eigen::Vector3d& p_body_cam);
Eigen::Matrix<double, 6, 3> seen_pose_by_translation(const FusionState& state);
/// About which gravity's tilt is told: the two axes of the map that are farther from it, x and y where z is
/// up.
Eigen::Matrix<double, 3, 2> tilt_axes(const Eigen::Vector3d& gravity_map);

/// Within `dt_s`, by gravity's tilt about tilt_axes().
Eigen::Matrix<double, 15, 2> state_by_gravity_tilt(const Eigen::Vector3d& gravity_map, double dt_s);

/// The calibration as blocks of a filter: time offset between IMU and camera, rotation and translation of the
/// camera in the body, direction of gravity in the map, and the camera's intrinsics. While the motion cannot
/// tell the first three from an error of the pose they are considered, not estimated.
class CalibrationStates {
 public:
  CalibrationStates(const CalibrationConfig& config, const Pose& T_body_cam);

  /// To be called when the filter's state was set anew. At first it adds the blocks. Later the camera has
  /// found the pose: then the body's is as wrong as the calibration, and correlated with it.
  void start(ErrorStateFilter& filter);
  /// What a wrong direction of gravity does to the state within `dt_s`.
  void propagate(ErrorStateFilter& filter, const Eigen::Vector3d& gravity_map, double dt_s) const;
  /// Freezes or frees the blocks by how much the motion has changed of late.
  void judge_excitation(ErrorStateFilter& filter);
  /// How the pose that the camera sees depends on the blocks.
  std::vector<PoseShift> pose_shifts(const FusionState& state) const;
  /// The camera's rotation in the body, if it is a state.
  std::optional<BlockId> rotation() const { return rotation_; }
  /// The camera's numbers, if they are states.
  std::optional<BlockId> intrinsics() const { return intrinsics_; }
  /// Whether contours have to tell of the camera's numbers.
  bool takes_contours() const { return intrinsics_.has_value(); }
  /// How the contour's residual depends on the camera's numbers, if they are states.
  std::optional<BlockRow> row_of(const ContourOffset& contour) const;
  /// Takes over what the filter's last update found; turns the direction of gravity likewise.
  void apply_corrections(const ErrorStateFilter& filter, Eigen::Vector3d* gravity_map);

  const Calibration& calibration() const { return found_; }

 private:
  void correlate(ErrorStateFilter& filter) const;
  void state_sigmas(const ErrorStateFilter& filter);

  CalibrationConfig config_;
  Pose T_body_cam_;  ///< as given
  Calibration found_;
  bool started_ = false;
  std::optional<BlockId> time_, vibration_, rotation_, translation_, gravity_, intrinsics_;
  // Mean and mean square of (velocity, rate) over the last half second.
  Vector6d motion_mean_ = Vector6d::Zero(), motion_square_ = Vector6d::Zero();
  /// Of the angular rate, rad/s, and of that mean: twice the one less the other follows an even change.
  Eigen::Vector3d rate_mean_ = Eigen::Vector3d::Zero(), rate_mean_of_mean_ = Eigen::Vector3d::Zero();
  TimeNs judged_ = 0;
};

}  // namespace evpose
