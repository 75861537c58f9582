// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>

#include "evpose/core/error.h"
#include "evpose/fusion/state.h"
#include "evpose/fusion/state_propagator.h"
#include "evpose/imu/imu.h"

namespace evpose {

class ConfigTable;

/// What the window keeps of a measurement: its normal equations where it was measured, or its contours one by
/// one, to be linearised anew with each step of the joint optimisation.
enum class Coupling { loose, tight };

/// Framework that fuses prediction (EV-Pose eq. 2, 4) and pose measurements (eq. 3).
enum class BackEndKind { ekf, graph, particle };

/// Of BackEndKind::graph.
struct WindowConfig {
  double length_s = 0.1;    ///< states older than this are marginalised
  int optimise_every = 10;  ///< updates
  int iterations = 2;
  bool background = false;  ///< optimise beside the updates ...
  int delay = 2;            ///< ... and use the result so many updates later
};
void describe(ConfigTable& table, WindowConfig& config);

/// Of BackEndKind::particle.
struct ParticleConfig {
  int particles = 500;
};
void describe(ConfigTable& table, ParticleConfig& config);

/// Online calibration by BackEndKind::ekf.
struct CalibrationConfig {
  bool time_offset = false;  ///< of the IMU against the camera
  bool rotation = false;     ///< of the camera in the body
  bool translation = false;  ///< likewise
  double start_time_sigma_s = 0.02;
  double start_rotation_sigma_rad = 0.02;
  double start_translation_sigma_m = 0.01;
  double least_velocity_m_s = 0.05;  ///< changes of velocity over half a second ...
  double least_rate_rad_s = 0.05;    ///< ... and of angular rate: below both it is frozen
};
void describe(ConfigTable& table, CalibrationConfig& config);

/// Whether offsets of single contour pieces are states, then the only slow errors; automatic: where the map
/// states errors of its contours, as one that was built from a cloud.
enum class PieceOffsets { off, on, automatic };

/// Errors that last, as states of BackEndKind::ekf.
struct SlowErrorsConfig {
  bool gravity = false;  ///< the map does not stand upright: direction of gravity in it
  double gravity_sigma_rad = 5e-3;
  bool pose_offset = false;  ///< error of the measured pose that lasts from update to update
  double offset_position_sigma_m = 5e-4;
  double offset_rotation_sigma_rad = 2e-4;
  double offset_s = 0.3;  ///< its correlation time
  PieceOffsets piece_offset = PieceOffsets::automatic;
  double piece_sigma_m = 6e-3;  ///< beside what the map states: some pieces stand on another edge
  double piece_m = 0.6;         ///< length of a piece
  int most_pieces = 200;        ///< that are states at a time
};
void describe(ConfigTable& table, SlowErrorsConfig& config);

/// What is found to be wrong with what was given.
struct Calibration {
  double time_offset_s = 0;  ///< IMU time of an instant minus camera time, beside the configured one
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  ///< true R_body_cam = turn * given
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();           ///< true p_body_cam = given + shift, m
  Eigen::Vector2d gravity_tilt_rad =
      Eigen::Vector2d::Zero();  ///< true gravity turned about the map's x and y
  double time_sigma_s = 0;
  Eigen::Vector3d shift_sigma_m = Eigen::Vector3d::Zero();
  Eigen::Vector2d gravity_sigma_rad = Eigen::Vector2d::Zero();
  Eigen::Vector3d turn_sigma_rad = Eigen::Vector3d::Zero();  ///< about the body's axes
  bool frozen = true;  ///< too little motion to tell it from an error of the pose
};

struct FusionConfig {
  BackEndKind kind = BackEndKind::ekf;
  Eigen::Vector3d gravity_map{0, 0, -9.81};  ///< m/s^2
  double imu_noise_scale =
      1.5;  ///< on the densities of imu.yaml: calibrations are made at rest, drones vibrate
  double imu_scale_sigma = 5e-3;    ///< faults of the IMU's scale and alignment
  double imu_scale_s = 0.3;         ///< ... and how long one and the same motion lasts
  double cv_accel_density = 1.5;    ///< constant velocity: white acceleration, m/s^2/sqrt(Hz); about 6 m/s^2
                                    ///< that keep up for 50 ms. More only opens the gate to clutter.
  double cv_angular_density = 1.5;  ///< ... white angular acceleration, rad/s^2/sqrt(Hz), likewise
  double blind_gyro_density = 0.1;  ///< rad/s/sqrt(Hz), while the IMU is not to be relied on
  double start_position_sigma_m = 2e-3;
  double start_rotation_sigma_rad = 2e-3;
  double start_velocity_sigma_m_s = 0.05;
  double start_gyro_bias_sigma_rad_s = 0.02;
  double start_accel_bias_sigma_m_s2 = 0.1;
  double start_angular_rate_sigma_rad_s = 0.2;  ///< constant velocity only
  Coupling coupling = Coupling::loose;
  WindowConfig window;
  ParticleConfig particle;
  CalibrationConfig calibration;
  SlowErrorsConfig slow;
};
void describe(ConfigTable& table, FusionConfig& config);

/// What the tracker asks of a fusion framework. Time goes forward: start, then predict and update in turn.
class BackEnd {
 public:
  explicit BackEnd(const StatePropagator& propagator) : propagator_(propagator) {}
  virtual ~BackEnd() = default;

  /// Begins, or begins anew; what was found of the calibration is kept.
  virtual void start(const FusionState& first) = 0;
  /// With the configured uncertainty. `angular_rate_body` is used by constant velocity only.
  void start(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body) {
    start(propagator_.initial_state(t, nav, angular_rate_body));
  }
  /// IMU model: one step between two samples; a.t must be the state's time. Both in the body frame.
  virtual void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) = 0;
  /// Constant velocity: to time t >= the state's.
  virtual void predict(TimeNs t) = 0;
  /// Measurement at the state's time, relative to state().nav.T_map_body, as registration returns it; its
  /// contours one by one for a back end that takes them.
  virtual void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) = 0;
  void update(const PoseInformation& measurement) { update(measurement, {}); }
  virtual bool takes_contours() const { return false; }
  /// The newest state, with its covariance. A copy can be carried to any later time by propagator().
  virtual const FusionState& state() const = 0;

  /// Of the pose that the next measurement will see: the state's, and that of the calibration.
  virtual Matrix6d measured_covariance() const { return state().pose_covariance(); }
  virtual Calibration calibration() const { return {}; }

  const StatePropagator& propagator() const { return propagator_; }

 protected:
  void set_gravity_map(const Eigen::Vector3d& gravity) { propagator_.set_gravity_map(gravity); }

 private:
  StatePropagator propagator_;
};

/// What `automatic` means for this map, and whether `on` can be had.
Expected<PieceOffsets> settled(const FusionConfig& config, bool map_states_errors);

/// `T_body_cam` as given: used by the calibration alone. Offsets of pieces must be settled.
std::unique_ptr<BackEnd> make_back_end(MotionModel model, const FusionConfig& config, const ImuNoise& noise,
                                       const Pose& T_body_cam);

}  // namespace evpose
