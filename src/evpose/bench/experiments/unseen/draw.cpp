// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/draw.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string_view>

#include "evpose/bench/experiments/unseen/drawer.h"
#include "evpose/core/config.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/files/crc32.h"

namespace evpose::experiments::unseen {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

constexpr std::array<Chip, 3> kChips{
    {{"dvxplorer", 0.5, 640, 480}, {"imx636", 0.4, 1280, 720}, {"davis346", 0.1, 346, 260}}};
constexpr Chip kQuickChip{"dvxplorer", 1, 320, 240};

void draw_camera(Drawer& d, Plan& plan, Draw& out) {
  plan.chip = plan.quick ? kQuickChip : d.pick<Chip>(kChips);
  const int width = plan.chip.width, height = plan.chip.height;
  const bool wide = d.chance(0.5);
  const double across_deg = wide ? d.uniform(86, 94) : d.uniform(58, 70);
  double k1 = 0, k2 = 0;
  if (!d.chance(0.2)) {
    k1 = wide ? d.uniform(-0.14, -0.05) : d.uniform(-0.2, 0.05);
    k2 = wide ? d.uniform(0.01, 0.025) : d.uniform(0, 0.06);
  }
  const double radius = std::tan(0.5 * kDegree * across_deg), square = radius * radius;
  plan.edge_radius = radius;
  d.set("camera.size", "custom");
  d.set("camera.width", width);
  d.set("camera.height", height);
  d.set("camera.focal_px", 0.5 * width / (radius * (1 + k1 * square + k2 * square * square)));
  d.set("camera.k1", k1);
  d.set("camera.k2", k2);
  for (const char* key : {"camera.p1", "camera.p2"}) d.set(key, k1 == 0 ? 0 : d.uniform(-1e-3, 1e-3));
  d.set_uniform("camera.pitch_down_deg", plan.landing ? 20 : -5, plan.landing ? 60 : 30);
  d.set("camera.yaw_left_deg", d.chance(0.15) ? d.uniform(-90, 90) : d.uniform(-2, 2));
  d.set_uniform("camera.roll_deg", -2, 2);
  d.set_uniform("camera.forward_m", -0.05, 0.12);
  d.set_uniform("camera.left_m", -0.06, 0.06);
  d.set_uniform("camera.up_m", -0.1, 0.06);
  out.camera =
      text(width, "x", height, ", ", number(across_deg, 2), " deg", k1 == 0 ? ", no distortion" : "");
}

void draw_vignetting(Drawer& d, Draw& out) {
  if (!d.chance(0.5)) return;
  const double share = d.uniform(0.1, 0.6);
  d.set("camera.vignetting", share);
  out.camera += text(", corners ", number(100 * share, 2), " % darker");
}

void draw_events(Drawer& d, const Plan& plan, Draw& out) {
  const double on = d.log_uniform(0.15, 0.4);
  d.set("events.threshold_on", on);
  d.set("events.threshold_off", on * d.uniform(0.8, 1.25));
  out.sensors = text("threshold ", number(on, 2));
  if (d.chance(0.5)) {
    d.set("events.preset", plan.chip.preset);
    out.sensors = text(plan.chip.preset, ", ", out.sensors);
    return;
  }
  d.set_uniform("events.threshold_sigma", 0.02, 0.05);
  d.set_log_uniform("events.refractory_us", 30, 500);
  d.set_log_uniform("events.bandwidth_hz_per_cd_m2", 30, 300);
  d.set_log_uniform("events.bandwidth_max_hz", 1000, 5000);
  d.set_log_uniform("events.leak_hz", 0.03, 0.3);
  const double noise = d.log_uniform(0.5, 3);
  d.set("events.shot_noise_dark_hz", 0.9 * noise);
  d.set("events.shot_noise_bright_hz", 0.14 * noise);
  d.set_log_uniform("events.hot_pixel_fraction", 1e-5, 2e-4);
}

/// Of those that the sensor's maker builds in, now and then one.
void draw_filters(Drawer& d, Draw& out) {
  if (!d.chance(0.15)) return;
  constexpr std::array<Choice, 3> kTrails{{{"first", 0.5}, {"second", 0.25}, {"all_but_first", 0.25}}};
  const char* trail = d.pick<Choice>(kTrails).word;
  d.set("read_out.trail", trail);
  d.set_log_uniform("read_out.trail_ms", 1, 20);
  out.sensors += text(", filter ", trail);
}

void draw_imu(Drawer& d, Draw& out) {
  const char* preset = d.chance(0.6) ? "pixhawk" : "adis";
  constexpr std::array<Choice, 3> kRates{{{"200", 0.5}, {"400", 0.3}, {"1000", 0.2}}};
  const char* rate = d.pick<Choice>(kRates).word;
  d.set("imu.preset", preset);
  d.set("imu.rate_hz", rate);
  if (d.chance(0.5)) d.set_uniform("imu.time_offset_s", -0.005, 0.005);
  out.sensors += text(", IMU ", preset, " ", rate, " Hz");
}

void draw_map(Drawer& d, const Plan& plan, Draw& out) {
  const FreeSpace& scanned = plan.place.scanned;
  const Vector3d centre = 0.5 * (scanned.low + scanned.high) + Vector3d(plan.street_x_m, 0, 0),
                 size = scanned.high - scanned.low;
  d.set("lidar.on", "true");
  const char* axes[] = {"x", "y", "z"};
  const char* ways[] = {"forward", "left", "up"};
  for (int i = 0; i < 3; ++i) {
    d.set(text("lidar.flight.centre_", axes[i], "_m"), centre[i]);
    d.set(text("lidar.flight.size_", ways[i], "_m"), size[i]);
  }
  d.set("lidar.flight.speed_m_s", plan.place.speed);
  d.set("lidar.flight.duration_s", plan.quick ? 5 : 20);
  const double range_m = d.log_uniform(0.008, 0.03);
  d.set("lidar.range_sigma_m", range_m);
  out.map = text("range ", number(1e3 * range_m, 2), " mm");
  if (!d.chance(0.5)) return;
  const double scan_m = d.log_uniform(0.002, 0.015);
  d.set("lidar.registration_m", scan_m);
  d.set_log_uniform("lidar.registration_deg", 0.01, 0.1);
  out.map += text(", scans ", number(1e3 * scan_m, 2), " mm");
}

/// What the scan has of other than noise.
void draw_map_faults(Drawer& d, Draw& out) {
  if (d.chance(0.5)) {
    const double drift_mm = d.log_uniform(1, 10);
    d.set("lidar.registration_drift_mm_per_10m", drift_mm);
    out.map += text(", drift ", number(drift_mm, 2), " mm in 10 m");
  }
  if (d.chance(0.4)) {
    const double missing = d.uniform(0.02, 0.25);
    d.set("lidar.missing_parts", missing);
    out.map += text(", ", number(100 * missing, 2), " % missing");
  }
  if (!d.chance(0.4)) return;
  const int moved = d.whole(1, 4);
  d.set("lidar.moved_furniture", moved);
  out.map += text(", ", moved, " moved");
}

/// Sigmas from half of an ordinary calibration's to all of it. What a calibration leaves of k1 is a matter of
/// pixels: the wider the lens, the less. The other terms are taken as right: errors that are drawn
/// independently would add up to what no calibration leaves.
void draw_calibration(Drawer& d, const Plan& plan, Draw& out) {
  constexpr double kK1Radius = 0.75;  // tangent up to which the sigma of k1 stands
  const double share = d.uniform(0.5, 1),
               k1 = 0.01 * std::min(1.0, std::pow(kK1Radius / plan.edge_radius, 3));
  const std::array<std::pair<const char*, double>, 6> ordinary{{{"focal_sigma", 0.003},
                                                                {"centre_sigma_px", 1},
                                                                {"k1_sigma", k1},
                                                                {"rotation_sigma_deg", 0.3},
                                                                {"translation_sigma_mm", 10},
                                                                {"time_sigma_ms", 2}}};
  for (const auto& [key, sigma] : ordinary) d.set(text("handed_over.", key), share * sigma);
  out.calibration = text("errors of ", number(share, 2), " of an ordinary one's");
}

}  // namespace

std::string number(double value, int digits) {
  char out[40];
  std::snprintf(out, sizeof out, "%.*g", digits, value);
  return out;
}

std::string Draw::key() const {
  std::uint32_t crc = 0;
  for (const std::string& setting : settings) {
    const std::string line = setting + "\n";
    crc = crc32(line.data(), line.size(), crc);
  }
  char out[12];
  std::snprintf(out, sizeof out, "%08x", crc);
  return out;
}

Draw draw_flight(int seed, int attempt, bool quick) {
  Draw out;
  const auto part = [&](Part p) { return Drawer(out, seed, attempt, p); };
  Drawer seeds = part(Part::seeds), kind = part(Part::kind);
  for (const char* key : {"seed", "world.seed", "trajectory.seed", "lidar.flight.seed"})
    seeds.set(key, std::to_string(seeds.whole(1, 999'999'999)));
  Plan plan{draw_place(kind), quick ? 1 : 0.1 * kind.whole(20, 40), quick};
  if (std::string_view(plan.place.kind) == "canyon") plan.street_x_m = draw_street_x(kind);
  kind.set("duration_s", plan.duration_s);
  Drawer world = part(Part::world), light = part(Part::light), motion = part(Part::motion),
         camera = part(Part::camera), events = part(Part::events), imu = part(Part::imu),
         calibration = part(Part::calibration), map = part(Part::map), looks = part(Part::looks),
         filters = part(Part::filters), optics = part(Part::optics);
  draw_world(world, plan, out);
  draw_looks(looks, plan, out);
  draw_light(light, plan, out);
  draw_motion(motion, plan, out);
  draw_camera(camera, plan, out);
  draw_vignetting(optics, out);
  draw_events(events, plan, out);
  draw_filters(filters, out);
  draw_imu(imu, out);
  draw_map(map, plan, out);
  draw_map_faults(map, out);
  draw_calibration(calibration, plan, out);
  return out;
}

Expected<sim::Scenario> scenario_of(const Draw& draw) {
  sim::Scenario scenario;
  ConfigTable table;
  describe(table, scenario);
  if (Status done = apply_assignments(table, draw.settings); !done) return done.error();
  return scenario;
}

}  // namespace evpose::experiments::unseen
