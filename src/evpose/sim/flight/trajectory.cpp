// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/flight/trajectory.h"

#include <cmath>
#include <numbers>

#include "evpose/core/config.h"

namespace evpose::sim {

BodyMotion Trajectory::at(double t_s) const {
  BodyMotion m = spline_.at(t_s);
  if (waves_.empty()) return m;
  AngularMotion attitude{m.T_map_body.q, m.rate, m.angular_acceleration};
  for (const Wave& wave : waves_) {
    const double omega = 2 * std::numbers::pi * wave.frequency_hz;
    for (int axis = 0; axis < 3; ++axis) {
      const double s = std::sin(omega * t_s + wave.phase_rad[axis]);
      const double c = std::cos(omega * t_s + wave.phase_rad[axis]);
      m.T_map_body.p[axis] += wave.position_m[axis] * s;
      m.velocity[axis] += wave.position_m[axis] * omega * c;
      m.acceleration[axis] -= wave.position_m[axis] * omega * omega * s;
      const double angle = wave.attitude_rad[axis];
      attitude.rotate(Eigen::Vector3d::Unit(axis), angle * s, angle * omega * c, -angle * omega * omega * s);
    }
  }
  m.T_map_body.q = attitude.q.normalized();
  m.rate = attitude.rate;
  m.angular_acceleration = attitude.angular_acceleration;
  return m;
}

void describe(ConfigTable& table, TrajectoryConfig& c) {
  using Kind = TrajectoryKind;
  table.add("kind", c.kind,
            ConfigTable::Choices<Kind>{{"square_spiral", Kind::square_spiral},
                                       {"landing", Kind::landing},
                                       {"hover", Kind::hover},
                                       {"aggressive", Kind::aggressive},
                                       {"slow", Kind::slow},
                                       {"lissajous", Kind::lissajous},
                                       {"sweep", Kind::sweep},
                                       {"traverse", Kind::traverse},
                                       {"waypoints", Kind::waypoints},
                                       {"file", Kind::file}},
            "shape of the flight path");
  table.add("duration_s", c.duration_s, "s", "duration of the flight; -1: as long as the kind takes",
            {-1, 14400});
  table.add("rest_s", c.rest_s, "s", "standing still at the start", {0, 600});
  table.add("seed", c.seed, "", "of everything random", {0, 2147483647});
  constexpr double kFar = 1e5;
  table.add("centre_x_m", c.centre_x_m, "m", "centre of the volume; landing: of the pad's top",
            {-kFar, kFar});
  table.add("centre_y_m", c.centre_y_m, "m", "centre of the volume; landing: of the pad's top",
            {-kFar, kFar});
  table.add("centre_z_m", c.centre_z_m, "m", "centre of the volume; landing: of the pad's top",
            {-kFar, kFar});
  table.add("size_forward_m", c.size_forward_m, "m", "of the volume, along the heading", {0, kFar});
  table.add("size_left_m", c.size_left_m, "m", "of the volume, across the heading", {0, kFar});
  table.add("size_up_m", c.size_up_m, "m", "of the volume, upwards", {0, kFar});
  table.add("heading_deg", c.heading_deg, "deg", "yaw of the body from +x, positive to the left",
            {-360, 360});
  table.add("speed_m_s", c.speed_m_s, "m/s", "peak speed; -1: the kind's own", {-1, 100});
  table.add("rate_deg_s", c.rate_deg_s, "deg/s", "peak angular rate without vibration; -1: the kind's own",
            {-1, 1000});
  table.add("sway_deg", c.sway_deg, "deg",
            "amplitude of the slow rotation back and forth; -1: the kind's own", {-1, 60});
  table.add("turn_deg_s", c.turn_deg_s, "deg/s", "steady yaw rate to the left", {-1000, 1000});
  table.add("bank", c.bank, "", "fraction of the tilt that a multicopter needs for its acceleration", {0, 1});
  table.add("start_height_m", c.start_height_m, "m", "landing: start above the pad's top", {0, 1000});
  table.add("start_forward_m", c.start_forward_m, "m", "landing: start ahead of the pad", {-kFar, kFar});
  table.add("start_left_m", c.start_left_m, "m", "landing: start to the left of the pad", {-kFar, kFar});
  table.add("end_height_m", c.end_height_m, "m", "landing: end above the pad's top", {0, 1000});
  table.add("wind_m", c.wind_m, "m", "landing: sideways disturbance, 1 sigma", {0, 10});
  table.add("vibration_mm", c.vibration_mm, "mm", "amplitude of the vibration; -1: the kind's own",
            {-1, 100});
  table.add("vibration_deg", c.vibration_deg, "deg", "amplitude of the vibration; -1: the kind's own",
            {-1, 10});
  table.add("vibration_hz", c.vibration_hz, "Hz", "frequency of the vibration", {0.1, 500});
  table.add("file", c.file, "waypoints: lines 'x y z yaw_deg [pause_s]'; file: TUM, or CSV as EuRoC's");
  table.add("file_knot_s", c.file_knot_s, "s",
            "knots of the spline through a file's poses: longer is smoother", {0.005, 10});
}

}  // namespace evpose::sim
