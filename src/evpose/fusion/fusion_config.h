// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "evpose/core/error.h"

namespace evpose {

class ConfigTable;

/// Framework that fuses prediction (EV-Pose eq. 2, 4) and pose measurements (eq. 3).
enum class BackEndKind { ekf, graph, particle };

/// Online calibration, by BackEndKind::ekf. What has the sigma zero is known.
struct CalibrationConfig {
  bool on = true;        ///< what the tracker is told to be uncertain becomes states
  bool gravity = false;  ///< direction of gravity in the map is a state: the map does not stand upright
  // Filled in by the tracker from TrackerSetup::calibration_sigma: what is a state, and its sigma at the
  // start.
  bool time_offset = false;  ///< of the IMU against the camera
  bool rotation = false;     ///< of the camera in the body
  bool translation = false;  ///< likewise
  bool intrinsics = false;   ///< of the camera: focal lengths, principal point, distortion
  double start_time_sigma_s = 2e-3;
  Eigen::Vector3d start_rotation_sigma_rad = Eigen::Vector3d::Constant(5e-3);
  Eigen::Vector3d start_translation_sigma_m = Eigen::Vector3d::Constant(0.01);
  Eigen::VectorXd start_intrinsics_sigma;  ///< as AdjustedCamera orders them
  double start_gravity_sigma_rad = 5e-3;   ///< about each horizontal axis
  /// Of intrinsics, rotation, translation and time, in this order; empty: they are independent.
  Eigen::MatrixXd start_correlation;

  enum class Kind { intrinsics, rotation, translation, time };
  /// Of states of two kinds at the start; empty without start_correlation.
  Eigen::MatrixXd correlation(Kind a, Kind b) const;
  Eigen::MatrixXd start_covariance(Kind a, Kind b) const;
  bool any() const { return time_offset || rotation || translation || gravity || intrinsics; }
};
void describe(ConfigTable& table, CalibrationConfig& config);

/// Whether offsets of single map segments are states, by BackEndKind::ekf; automatic: where contours may
/// stand off. The map states errors of its contours, as one that was built from a cloud, or the lens is not
/// known well and is no state.
enum class SegmentOffsetUse { off, on, automatic };

/// Of the model of a map whose contours stand off. Constants of the method, without keys.
struct SegmentOffsetConfig {
  double sigma_m = 6e-3;  ///< of an offset, beside what the map states: some segments stand on another edge
  double sigma_px = 0.2;  ///< of an offset where the map states none, in the first view of it
  double length_m = 0.6;  ///< of a segment: shorter ones are seen too briefly to be told from the pose
  int most = 200;         ///< that are states at a time; the update's cost grows with its square
};

struct FusionConfig {
  BackEndKind kind = BackEndKind::ekf;
  Eigen::Vector3d gravity_map{0, 0, -9.81};  ///< m/s^2
  double imu_noise_scale = 1.5;  ///< on the IMU's densities: these are measured at rest, drones vibrate
  double start_position_sigma_m = 2e-3;
  double start_rotation_sigma_rad = 2e-3;
  CalibrationConfig calibration;
  SegmentOffsetUse segment_offsets = SegmentOffsetUse::automatic;
  double window_s = 0.1;  ///< graph: older states are marginalised
  int particles = 500;    ///< particle filter

  // Constants of the method, without keys.
  double start_velocity_sigma_m_s = 0.05;
  double start_gyro_bias_sigma_rad_s = 0.02;
  double start_accel_bias_sigma_m_s2 = 0.1;
  double start_angular_rate_sigma_rad_s = 0.2;  ///< constant velocity only
  double imu_scale_sigma = 5e-3;                ///< faults of the IMU's scale and alignment
  /// Constant velocity: white acceleration, m/s^2/sqrt(Hz); about 6 m/s^2 that keep up for 50 ms. More only
  /// opens the gate to clutter.
  double cv_accel_density = 1.5;
  double cv_angular_density = 1.5;  ///< likewise white angular acceleration, rad/s^2/sqrt(Hz)
  SegmentOffsetConfig segments;
};
void describe(ConfigTable& table, FusionConfig& config);

/// The configuration with its automatic choices made for this map. Error: the framework cannot estimate what
/// it is asked to.
Expected<FusionConfig> resolved(const FusionConfig& config, bool contours_stand_off);

}  // namespace evpose
