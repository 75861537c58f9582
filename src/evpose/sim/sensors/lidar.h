// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/maps/ply.h"
#include "evpose/sim/flight/trajectory.h"
#include "evpose/sim/light/ray_caster.h"

namespace evpose {
class ConfigTable;
class ThreadPool;
}  // namespace evpose

namespace evpose::sim {

/// A LiDAR like the Livox MID-360 and the mapping flight with it.
struct LidarConfig {
  LidarConfig();

  bool on = false;
  double points_per_s = 200000;
  int keep_every = 4;                 ///< every n-th point is kept
  double scan_s = 0.1;                ///< length of a scan, which has one registration error
  double down_deg = -7, up_deg = 52;  ///< vertical field of view; 360 degrees horizontally
  double mount_pitch_deg = 25;        ///< pitch of the sensor, positive down
  double range_sigma_m = 0.015;       ///< noise along the beam
  double range_min_m = 0.1, range_max_m = 40;
  double max_incidence_deg = 86;  ///< no return from surfaces at a larger angle of incidence
  double beam_deg = 0.14;         ///< full divergence
  double mixed_m = 0.03;          ///< limit of the mixed-pixel error of a beam across a depth step
  double registration_m = 0, registration_deg = 0;  ///< error of each scan, 1 sigma of each axis
  double registration_drift_mm_per_10m = 0;  ///< random walk of the registered place, 1 sigma of each axis
  double missing_parts = 0;  ///< fraction of the scanned surface that is left out, in coherent parts
  int moved_furniture = 0;   ///< pieces that stood elsewhere when the scan was made
  TrajectoryConfig flight;
};
void describe(ConfigTable& table, LidarConfig& config);

/// Unit vector of the beam at a time, sensor frame (x forward, y left, z up). The pattern does not repeat.
Eigen::Vector3d lidar_beam(const LidarConfig& config, double t_s);

/// Scans the static scene. May be used from several threads.
class Lidar {
 public:
  /// Keeps references, except for the config.
  Lidar(const RayCaster& rays, const Trajectory& trajectory, const LidarConfig& config, std::uint64_t seed);

  int scans() const;
  /// Points of one scan as registered, map frame. Depends on nothing but its number and the seed.
  std::vector<CloudPoint> scan(int number) const;

 private:
  const RayCaster& rays_;
  const Trajectory& trajectory_;
  LidarConfig config_;
  std::uint64_t seed_;
  std::vector<Pose> drift_;  ///< of each scan
};

/// Flies, scans and writes the merged cloud, unless off. Errors: no such flight, too many points, furniture
/// that cannot be moved, or the file cannot be written.
Status write_lidar(const std::string& path, const RayCaster& rays, const LidarConfig& config,
                   std::uint64_t seed, ThreadPool& pool);

}  // namespace evpose::sim
