// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"

namespace evpose {

/// Kalman update of the state at its own time by a measurement relative to its pose (EV-Pose eq. 5).
void correct(FusionState& state, const PoseInformation& measurement);

/// Error-state Kalman filter on T_map_body, velocity and IMU biases: the fusion of prediction (EV-Pose eq. 2,
/// 4) and pose measurement (eq. 3, 5) for one newest state. If asked, the time offset between IMU and camera
/// and the camera's rotation are further states. While the motion cannot tell them they are considered, not
/// estimated: their uncertainty counts, their values stay (Schmidt).
class Ekf : public BackEnd {
 public:
  explicit Ekf(const Motion& motion, const CalibrationConfig& calibration = {}, const Pose& T_body_cam = {})
      : BackEnd(motion), config_(calibration), camera_in_body_(T_body_cam.p) {}

  using BackEnd::start;
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, bool suspect) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement) override;
  const FusionState& state() const override { return state_; }
  Matrix6d measured_covariance() const override;
  Calibration calibration() const override;

 private:
  using ByCalibration = Eigen::Matrix<double, 6, 4>;
  bool calibrates() const { return config_.time_offset || config_.rotation; }
  /// Derivative of the measured pose by (time offset, turn).
  ByCalibration by_calibration() const;
  void watch_motion();

  FusionState state_;
  CalibrationConfig config_;
  Eigen::Vector3d camera_in_body_;
  Calibration calibration_;
  Eigen::Matrix<double, 15, 4> cross_ = Eigen::Matrix<double, 15, 4>::Zero();
  Eigen::Matrix4d spread_ = Eigen::Matrix4d::Zero();  ///< covariance of (time offset, turn)
  // Mean and mean square of (velocity, rate) over the last half second.
  Vector6d motion_mean_ = Vector6d::Zero(), motion_square_ = Vector6d::Zero();
  TimeNs watched_ = 0;
};

}  // namespace evpose
