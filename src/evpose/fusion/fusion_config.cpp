// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/fusion_config.h"

#include <utility>

#include "evpose/core/config.h"

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
  table.add("start_position_sigma_m", c.start_position_sigma_m, "m", "error of the start position, 1 sigma",
            {1e-6, 10});
  table.add("start_rotation_sigma_rad", c.start_rotation_sigma_rad, "rad",
            "error of the start attitude, 1 sigma", {1e-6, 1});
  table.group("calibration", c.calibration);
  table.add(
      "segment_offsets", c.segment_offsets,
      {{"off", SegmentOffsetUse::off}, {"on", SegmentOffsetUse::on}, {"auto", SegmentOffsetUse::automatic}},
      "estimate the offset of each map segment in view (ekf); auto: of maps that state errors, and without "
      "an IMU where the lens is not known");
  table.add("window_s", c.window_s, "s", "graph: states older than this are marginalised", {1e-3, 10});
  table.add("particles", c.particles, "", "particle filter: number of particles", {20, 1e6});
}

void describe(ConfigTable& table, CalibrationConfig& c) {
  table.add(
      "on", c.on,
      "estimate what is uncertain of the calibration: intrinsics, camera in the body, time offset (ekf)");
  table.add("gravity", c.gravity, "estimate the direction of gravity in the map (ekf)");
}

Eigen::MatrixXd CalibrationConfig::correlation(Kind a, Kind b) const {
  if (start_correlation.size() == 0) return {};
  const Eigen::Index n = start_correlation.rows() - 7;
  const auto at = [&](Kind kind) -> std::pair<Eigen::Index, Eigen::Index> {
    switch (kind) {
      case Kind::intrinsics:
        return {0, n};
      case Kind::rotation:
        return {n, 3};
      case Kind::translation:
        return {n + 3, 3};
      case Kind::time:
        break;
    }
    return {n + 6, 1};
  };
  const auto [first, rows] = at(a);
  const auto [second, columns] = at(b);
  return start_correlation.block(first, second, rows, columns);
}

Eigen::MatrixXd CalibrationConfig::start_covariance(Kind a, Kind b) const {
  const auto sigma = [&](Kind kind) -> Eigen::VectorXd {
    switch (kind) {
      case Kind::intrinsics:
        return start_intrinsics_sigma;
      case Kind::rotation:
        return start_rotation_sigma_rad;
      case Kind::translation:
        return start_translation_sigma_m;
      case Kind::time:
        break;
    }
    return Eigen::VectorXd::Constant(1, start_time_sigma_s);
  };
  return sigma(a).asDiagonal() * correlation(a, b) * sigma(b).asDiagonal();
}

Expected<FusionConfig> resolved(const FusionConfig& config, bool contours_stand_off) {
  FusionConfig out = config;
  const bool filter = config.kind == BackEndKind::ekf;
  if (!filter && config.calibration.any())
    return Error{"fusion.kind", "only ekf estimates the calibration",
                 "set fusion.kind=ekf, or fusion.calibration.gravity=false"};
  if (!filter && config.segment_offsets == SegmentOffsetUse::on)
    return Error{"fusion.kind", "only ekf estimates offsets of map segments",
                 "set fusion.kind=ekf, or fusion.segment_offsets=off"};
  if (config.segment_offsets == SegmentOffsetUse::automatic)
    out.segment_offsets = filter && contours_stand_off ? SegmentOffsetUse::on : SegmentOffsetUse::off;
  return out;
}

}  // namespace evpose
