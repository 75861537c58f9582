// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <numbers>
#include <string_view>

#include "evpose/bench/experiments/unseen/drawer.h"

namespace evpose::experiments::unseen {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

/// A way to fly, with ranges for a hall.
struct Motion {
  const char* word;
  const char* kind;
  double weight;
  std::array<double, 2> speed_m_s, rate_deg_s;
  std::array<double, 2> size_m;  ///< forward and left; up: half of it
  double turning;                ///< probability of a steady turn
};
constexpr std::array<Motion, 5> kMotions{
    {{"square spiral", "square_spiral", 0.28, {0.4, 1.5}, {10, 30}, {2, 3.6}, 0.25},
     {"hover", "hover", 0.17, {0.05, 0.3}, {5, 15}, {0.3, 0.8}, 0.1},
     {"fast", "aggressive", 0.2, {1.5, 3}, {60, 180}, {2, 3.6}, 0.1},
     {"sideways", "sweep", 0.2, {0.5, 2}, {8, 30}, {2, 3.6}, 0.1},
     {"turning", "lissajous", 0.15, {0.4, 1.2}, {20, 60}, {1, 3}, 1}}};
constexpr double kLandings = 0.3;   // share, in the courtyard
constexpr double kTraverses = 0.2;  // share, in the canyon

/// A volume of at most this size, turned by the heading, somewhere in the free space.
void place_volume(Drawer& d, const FreeSpace& free, double heading_deg, Vector3d size) {
  const double c = std::abs(std::cos(kDegree * heading_deg)), s = std::abs(std::sin(kDegree * heading_deg));
  const Vector3d room = free.high - free.low;
  const auto extent = [&]() -> Vector3d {
    return {c * size.x() + s * size.y(), s * size.x() + c * size.y(), size.z()};
  };
  size.head<2>() *= std::min({1.0, room.x() / extent().x(), room.y() / extent().y()});
  size.z() = std::min(size.z(), room.z());
  const Vector3d margin = 0.5 * extent();
  for (int axis = 0; axis < 3; ++axis) {
    const double low = free.low[axis] + margin[axis], high = free.high[axis] - margin[axis];
    d.set(text("trajectory.centre_", "xyz"[axis], "_m"), d.uniform(low, std::max(low, high)));
  }
  d.set("trajectory.size_forward_m", size.x());
  d.set("trajectory.size_left_m", size.y());
  d.set("trajectory.size_up_m", size.z());
}

/// By its acceleration, which is what autopilots limit: 30 m/s^2 is the most that they take for sound.
void draw_vibration(Drawer& d) {
  constexpr double kMost_mm = 0.4;
  if (!d.chance(0.4)) return;
  const double acceleration_m_s2 = d.log_uniform(1, 25), rate_deg_s = d.log_uniform(1, 15),
               frequency_hz = d.uniform(20, 150), omega = 2 * std::numbers::pi * frequency_hz;
  d.set("trajectory.vibration_mm", std::min(kMost_mm, 1e3 * acceleration_m_s2 / (omega * omega)));
  d.set("trajectory.vibration_deg", rate_deg_s / omega);
  d.set("trajectory.vibration_hz", frequency_hz);
}

void draw_landing(Drawer& d, Draw& out, Plan& plan) {
  constexpr double kPad_m = 0.3, kEnd_m = 0.25, kStand_s = 0.2,
                   kPeak = 1.875;  // the last: over the mean speed
  plan.landing = true;
  const double speed = d.uniform(0.8, 2.5);
  const double height = kEnd_m + speed * (plan.duration_s - kStand_s) / kPeak;
  d.set("trajectory.kind", "landing");
  for (const char* axis : {"x", "y"}) d.set(text("trajectory.centre_", axis, "_m"), "0");
  d.set("trajectory.centre_z_m", kPad_m);
  d.set("trajectory.speed_m_s", speed);
  d.set("trajectory.start_height_m", height);
  d.set("trajectory.end_height_m", kEnd_m);
  // Inside the cone that is free above the pad.
  for (const char* way : {"forward", "left"})
    d.set_uniform(text("trajectory.start_", way, "_m"), -0.4 * height, 0.4 * height);
  d.set_uniform("trajectory.wind_m", 0, 0.12);
  d.set_uniform("trajectory.heading_deg", 0, 360);
  out.motion = text("landing, ", number(speed, 2), " m/s");
}

void draw_traverse(Drawer& d, const Plan& plan, Draw& out) {
  const double speed = d.uniform(2, 7);
  d.set("trajectory.kind", "traverse");
  d.set("trajectory.speed_m_s", speed);
  d.set("trajectory.heading_deg", d.chance(0.5) ? 0 : 180);
  d.set("trajectory.centre_x_m", plan.street_x_m);
  d.set_uniform("trajectory.centre_y_m", -0.4, 0.4);
  d.set_uniform("trajectory.centre_z_m", plan.movers ? 3.2 : 2.2, 4.8);
  d.set("trajectory.size_forward_m", 1.2 * speed * plan.duration_s);
  d.set_uniform("trajectory.size_left_m", 0, 2);
  d.set_uniform("trajectory.size_up_m", 0.2, 1.5);
  out.motion = text("along the street, ", number(speed, 2), " m/s");
}

}  // namespace

void draw_motion(Drawer& d, Plan& plan, Draw& out) {
  const std::string_view kind = plan.place.kind;
  draw_vibration(d);
  if (kind == "courtyard" && d.chance(kLandings)) return draw_landing(d, out, plan);
  if (kind == "canyon" && d.chance(kTraverses)) return draw_traverse(d, plan, out);
  const Motion& motion = d.pick<Motion>(kMotions);
  const double speed = plan.place.speed * d.uniform(motion.speed_m_s[0], motion.speed_m_s[1]);
  const double heading_deg = d.uniform(0, 360);
  d.set("trajectory.kind", motion.kind);
  d.set("trajectory.speed_m_s", speed);
  d.set_log_uniform("trajectory.rate_deg_s", motion.rate_deg_s[0], motion.rate_deg_s[1]);
  d.set("trajectory.heading_deg", heading_deg);
  if (d.chance(motion.turning)) d.set("trajectory.turn_deg_s", (d.chance(0.5) ? 1 : -1) * d.uniform(10, 40));
  FreeSpace free = plan.place.free;
  if (plan.movers && kind == "canyon") free.low.z() = 2.3;  // above the roofs of cars
  free.low.x() += plan.street_x_m, free.high.x() += plan.street_x_m;
  const auto side = [&] { return plan.place.size * d.uniform(motion.size_m[0], motion.size_m[1]); };
  const double forward = side(), left = side(), up = 0.5 * side();
  place_volume(d, free, heading_deg, {forward, left, up});
  out.motion = text(motion.word, ", ", number(speed, 2), " m/s");
}

}  // namespace evpose::experiments::unseen
