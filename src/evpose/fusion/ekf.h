// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"

namespace evpose {

/// Kalman update of the state at its own time by a measurement relative to its pose (EV-Pose eq. 5).
void correct(FusionState& state, const PoseInformation& measurement);

/// Error-state Kalman filter on T_map_body, velocity and IMU biases: the fusion of prediction (EV-Pose eq. 2,
/// 4) and pose measurement (eq. 3, 5) for one newest state. If asked, slow errors are further states: time
/// offset between IMU and camera, rotation and place of the camera, direction of gravity, an error of the
/// measured pose that lasts. While the motion cannot tell the calibration from an error of the pose it is
/// considered, not estimated: its uncertainty counts, its values stay (Schmidt).
class Ekf : public BackEnd {
 public:
  explicit Ekf(const StatePropagator& propagator, const CalibrationConfig& calibration = {},
               const SlowErrorsConfig& slow = {}, const Pose& T_body_cam = {});

  using BackEnd::start;
  using BackEnd::update;
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  const FusionState& state() const override { return state_; }
  Matrix6d measured_covariance() const override;
  Calibration calibration() const override;

 private:
  using BySlow = Eigen::Matrix<double, 6, 15>;
  /// Derivative of the measured pose by the slow errors.
  BySlow by_slow() const;
  void carry(const Matrix15d& F, double dt);
  void apply(const Vector15d& d);
  void watch_motion();

  FusionState state_;
  CalibrationConfig config_;
  SlowErrorsConfig slow_config_;
  Pose T_body_cam_;
  bool slow_ = false, started_ = false;
  Calibration calibration_;
  Vector6d offset_ = Vector6d::Zero();    ///< of the measured pose, that lasts
  Matrix15d cross_ = Matrix15d::Zero();   ///< covariance of the state with the slow errors
  Matrix15d spread_ = Matrix15d::Zero();  ///< covariance of the slow errors
  // Mean and mean square of (velocity, rate) over the last half second.
  Vector6d motion_mean_ = Vector6d::Zero(), motion_square_ = Vector6d::Zero();
  TimeNs watched_ = 0;
};

}  // namespace evpose
