// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/sim/flight/motion.h"
#include "evpose/sim/flight/pose_spline.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

/// BodyMotion of the body: a spline of poses with a vibration on top. All derivatives are exact.
class Trajectory {
 public:
  /// amplitude * sin(2 pi frequency t + phase) for each axis.
  struct Wave {
    double frequency_hz = 0;
    Eigen::Vector3d phase_rad = Eigen::Vector3d::Zero();
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< amplitude, map frame
    Eigen::Vector3d attitude_rad =
        Eigen::Vector3d::Zero();  ///< amplitude, about the body's x, then y, then z
  };
  /// `duration_s`: at() is valid for 0 .. duration; beyond the last poses of the spline the body comes to
  /// rest.
  Trajectory(PoseSpline spline, std::vector<Wave> waves, double duration_s)
      : spline_(std::move(spline)), waves_(std::move(waves)), duration_s_(duration_s) {}

  BodyMotion at(double t_s) const;
  double duration_s() const { return duration_s_; }

 private:
  PoseSpline spline_;
  std::vector<Wave> waves_;
  double duration_s_;
};

enum class TrajectoryKind : std::uint8_t {
  square_spiral,
  landing,
  hover,
  aggressive,
  slow,
  lissajous,
  sweep,
  traverse,
  waypoints,
  file
};

/// Lengths along forward, left and up, where forward is the heading. Negative: the kind's own value.
struct TrajectoryConfig {
  TrajectoryKind kind = TrajectoryKind::square_spiral;
  double duration_s = -1;  ///< the flight is cut or extended to it; own: what the kind takes, or 10 s
  double rest_s = 0;       ///< standing still at the start, then a second to reach speed
  int seed = 1;
  double centre_x_m = 3.25, centre_y_m = 3, centre_z_m = 1.5;  ///< of the volume; landing: of the pad's top
  double size_forward_m = 3.5, size_left_m = 3, size_up_m = 1.4;  ///< of the volume
  double heading_deg = 0;                                         ///< from +x to the left
  double speed_m_s = -1;                                          ///< peak
  double rate_deg_s = -1;                                         ///< peak, without vibration
  double sway_deg = -1;   ///< amplitude of the slow rotation back and forth
  double turn_deg_s = 0;  ///< steady yaw rate to the left
  double bank = 0.5;      ///< fraction of the tilt that a multicopter needs for its acceleration
  double start_height_m = 6, start_forward_m = 0, start_left_m = 0;  ///< landing: start above the pad's top
  double end_height_m = 0.25;                                        ///< landing: end above it
  double wind_m = 0.08;  ///< landing: 1 sigma of the sideways disturbance
  double vibration_mm = -1, vibration_deg = -1, vibration_hz = 25;  ///< amplitudes
  std::string file;           ///< waypoints: "x y z yaw_deg [pause_s]" a line; file: TUM, or CSV as EuRoC's
  double file_knot_s = 0.05;  ///< of the spline laid through the poses of a file: longer is smoother
};
void describe(ConfigTable& table, TrajectoryConfig& config);

/// Errors: a file that cannot be read or is no trajectory.
Expected<Trajectory> make_trajectory(const TrajectoryConfig& config);

}  // namespace evpose::sim
