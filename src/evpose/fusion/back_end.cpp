// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/back_end.h"

#include "evpose/core/config.h"
#include "evpose/core/error.h"
#include "evpose/fusion/ekf.h"
#include "evpose/fusion/graph.h"
#include "evpose/fusion/particle_filter.h"
#include "evpose/fusion/piece_ekf.h"

namespace evpose {

void describe(ConfigTable& table, FusionConfig& c) {
  table.add(
      "kind", c.kind,
      {{"ekf", BackEndKind::ekf}, {"graph", BackEndKind::graph}, {"particle", BackEndKind::particle}},
      "framework of the fusion: error-state Kalman filter, factor graph over a window, particle filter");
  table.add("gravity_x", c.gravity_map.x(), "m/s^2", "gravity in the map frame", {-20, 20});
  table.add("gravity_y", c.gravity_map.y(), "m/s^2", "gravity in the map frame", {-20, 20});
  table.add("gravity_z", c.gravity_map.z(), "m/s^2", "gravity in the map frame", {-20, 20});
  table.add("imu_noise_scale", c.imu_noise_scale, "", "factor on the IMU's noise densities", {0.01, 1000});
  table.add("imu_scale_sigma", c.imu_scale_sigma, "", "faults of the IMU's scale and alignment, 1 sigma",
            {0, 0.5});
  table.add("imu_scale_s", c.imu_scale_s, "s", "how long a motion lasts that they act on", {0, 100});
  table.add("cv_accel_density", c.cv_accel_density, "m/s^2/sqrt(Hz)", "without IMU: white acceleration",
            {1e-6, 1e6});
  table.add("cv_angular_density", c.cv_angular_density, "rad/s^2/sqrt(Hz)",
            "without IMU: white angular acceleration", {1e-6, 1e6});
  table.add("blind_gyro_density", c.blind_gyro_density, "rad/s/sqrt(Hz)",
            "white angular rate while the IMU is saturated, stuck or silent", {1e-6, 1e6});
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
  table.add(
      "coupling", c.coupling, {{"loose", Coupling::loose}, {"tight", Coupling::tight}},
      "graph: the window keeps a measurement's normal equations, or its contours to linearise them anew");
  table.group("window", c.window);
  table.group("particle", c.particle);
  table.group("calibration", c.calibration);
  table.group("slow", c.slow);
}

void describe(ConfigTable& table, SlowErrorsConfig& c) {
  table.add("gravity", c.gravity, "estimate the direction of gravity in the map (ekf)");
  table.add("gravity_sigma_rad", c.gravity_sigma_rad, "rad", "tilt of the map, 1 sigma about each axis",
            {1e-6, 1});
  table.add("pose_offset", c.pose_offset, "estimate an error of the measured pose that lasts (ekf)");
  table.add("offset_position_sigma_m", c.offset_position_sigma_m, "m", "its size, 1 sigma", {0, 1});
  table.add("offset_rotation_sigma_rad", c.offset_rotation_sigma_rad, "rad", "its size, 1 sigma", {0, 1});
  table.add("offset_s", c.offset_s, "s", "its correlation time", {1e-3, 1000});
  table.add(
      "piece_offset", c.piece_offset,
      {{"off", PieceOffsets::off}, {"on", PieceOffsets::on}, {"auto", PieceOffsets::automatic}},
      "estimate the offset of each contour piece (ekf, without other slow errors and calibration); auto: of "
      "maps that state errors");
  table.add("piece_sigma_m", c.piece_sigma_m, "m", "its size, 1 sigma, beside what the map states",
            {1e-6, 1});
  table.add("piece_m", c.piece_m, "m", "length of a piece", {1e-2, 100});
  table.add("most_pieces", c.most_pieces, "", "so many at a time", {1, 1000});
}

void describe(ConfigTable& table, CalibrationConfig& c) {
  table.add("time_offset", c.time_offset, "estimate the time offset of the IMU against the camera (ekf)");
  table.add("rotation", c.rotation, "estimate the rotation of the camera in the body (ekf)");
  table.add("translation", c.translation, "estimate the place of the camera in the body (ekf)");
  table.add("start_translation_sigma_m", c.start_translation_sigma_m, "m",
            "error of the given place, 1 sigma", {1e-6, 1});
  table.add("start_time_sigma_s", c.start_time_sigma_s, "s", "error of the given time offset, 1 sigma",
            {1e-6, 1});
  table.add("start_rotation_sigma_rad", c.start_rotation_sigma_rad, "rad",
            "error of the given rotation, 1 sigma", {1e-6, 1});
  table.add("least_velocity_m_s", c.least_velocity_m_s, "m/s",
            "frozen while velocity changes by less over half a second ...", {0, 100});
  table.add("least_rate_rad_s", c.least_rate_rad_s, "rad/s", "... and the angular rate by less than this",
            {0, 100});
}

Expected<PieceOffsets> settled(const FusionConfig& config, bool map_states_errors) {
  const CalibrationConfig& c = config.calibration;
  const bool possible = config.kind == BackEndKind::ekf && !config.slow.gravity && !config.slow.pose_offset &&
                        !c.time_offset && !c.rotation && !c.translation;
  if (config.slow.piece_offset == PieceOffsets::on && !possible)
    return Error{"fusion.slow.piece_offset",
                 "on needs fusion.kind=ekf without calibration and other slow errors",
                 "leave one of them out"};
  if (config.slow.piece_offset != PieceOffsets::automatic) return config.slow.piece_offset;
  return possible && map_states_errors ? PieceOffsets::on : PieceOffsets::off;
}

std::unique_ptr<BackEnd> make_back_end(MotionModel model, const FusionConfig& config, const ImuNoise& noise,
                                       const Pose& T_body_cam) {
  const StatePropagator propagator(model, config, noise);
  switch (config.kind) {
    case BackEndKind::ekf:
      if (config.slow.piece_offset == PieceOffsets::on)
        return std::make_unique<PieceEkf>(propagator, config.slow);
      return std::make_unique<Ekf>(propagator, config.calibration, config.slow, T_body_cam);
    case BackEndKind::graph:
      return std::make_unique<Graph>(propagator, config.window, config.coupling);
    case BackEndKind::particle:
      return std::make_unique<ParticleFilter>(propagator, config.particle);
  }
  EVPOSE_CHECK(false);
  return nullptr;
}

}  // namespace evpose
