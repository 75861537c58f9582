// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "evpose/imu/imu.h"
#include "evpose/imu/strapdown.h"

namespace evpose {

class ConfigTable;

using Matrix15d = Eigen::Matrix<double, 15, 15>;
using Vector15d = Eigen::Matrix<double, 15, 1>;

/// How the state moves between measurements.
enum class MotionModel { imu, constant_velocity };

struct EkfConfig {
  Eigen::Vector3d gravity_map{0, 0, -9.81};  ///< m/s^2
  double imu_noise_scale =
      1.5;  ///< on the densities of imu.yaml: calibrations are made at rest, drones vibrate
  double cv_accel_density = 1.5;    ///< constant velocity: white acceleration, m/s^2/sqrt(Hz); about 6 m/s^2
                                    ///< that keep up for 50 ms. More only opens the gate to clutter.
  double cv_angular_density = 1.5;  ///< ... white angular acceleration, rad/s^2/sqrt(Hz), likewise
  double start_position_sigma_m = 2e-3;
  double start_rotation_sigma_rad = 2e-3;
  double start_velocity_sigma_m_s = 0.05;
  double start_gyro_bias_sigma_rad_s = 0.02;
  double start_accel_bias_sigma_m_s2 = 0.1;
  double start_angular_rate_sigma_rad_s = 0.2;  ///< constant velocity only
};
void describe(ConfigTable& table, EkfConfig& config);

/// State of the fusion; its error is ordered (p, phi, v, b_g, b_a), perturbed as Pose::plus.
struct FusionState {
  TimeNs t = 0;
  NavState nav;
  Eigen::Vector3d gyro_bias =
      Eigen::Vector3d::Zero();  ///< rad/s; constant velocity: minus the body's angular rate
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< m/s^2; unused under constant velocity
  Matrix15d covariance = Matrix15d::Zero();

  Matrix6d pose_covariance() const { return covariance.topLeftCorner<6, 6>(); }
};

/// A pose measurement in information form, relative to the predicted pose: near it the measurement's cost is
/// d^T information d / 2 - vector^T d, with d as in Pose::plus. The information may be singular.
struct PoseInformation {
  Matrix6d information = Matrix6d::Zero();
  Vector6d vector = Vector6d::Zero();
};

/// Error-state Kalman filter on T_map_body, velocity and IMU biases: the fusion of prediction (EV-Pose eq. 2,
/// 4) and pose measurement (eq. 3, 5) for one newest state. Without an IMU the same filter runs on a
/// gyroscope that reads zero: its "bias" is then minus the angular rate.
class Ekf {
 public:
  Ekf(MotionModel model, const EkfConfig& config, const ImuNoise& noise);

  /// `angular_rate_body` is used by constant velocity only.
  void start(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body);

  /// IMU model: one step between two samples; a.t must be the state's time. Both in the body frame.
  void predict(const ImuSample& a, const ImuSample& b);
  /// Constant velocity: to time t >= the state's.
  void predict(TimeNs t);

  const FusionState& state() const { return state_; }
  MotionModel model() const { return model_; }
  /// Angular rate of the body, rad/s: of the last prediction step.
  const Eigen::Vector3d& angular_rate() const { return angular_rate_; }

  /// Normalised innovation squared of the measurement, divided by its rank: about 1 when state and
  /// measurement both know how good they are.
  double innovation(const PoseInformation& measurement) const;

  /// Measurement relative to state().nav.T_map_body, as registration returns it.
  void update(const PoseInformation& measurement);

 private:
  void propagate_covariance(const NavState& before, const Eigen::Vector3d& rate, const Eigen::Vector3d& force,
                            double dt_s);

  MotionModel model_;
  EkfConfig config_;
  ImuNoise noise_;
  FusionState state_;
  Eigen::Vector3d angular_rate_ = Eigen::Vector3d::Zero();
};

}  // namespace evpose
