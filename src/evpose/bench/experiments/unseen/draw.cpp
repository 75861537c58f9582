// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/draw.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <span>
#include <string_view>

#include "evpose/core/config.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/files/crc32.h"
#include "evpose/sim/world/random.h"

namespace evpose::experiments::unseen {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

/// Each part of a draw has random numbers of its own: a change of one leaves the others as they were.
enum class Part : std::uint64_t { kind, world, light, motion, camera, events, imu, calibration, map, seeds };

std::string number(double value, int digits = 4) {
  char out[40];
  std::snprintf(out, sizeof out, "%.*g", digits, value);
  return out;
}

/// Random numbers of one part, and the settings made of them.
class Drawer {
 public:
  Drawer(Draw& draw, int seed, int attempt, Part part)
      : draw_(draw),
        random_(static_cast<std::uint64_t>(seed),
                static_cast<std::uint64_t>(attempt) * 64 + static_cast<std::uint64_t>(part)) {}

  double uniform(double low, double high) { return random_.uniform(low, high); }
  double log_uniform(double low, double high) {
    return std::exp(random_.uniform(std::log(low), std::log(high)));
  }
  bool chance(double probability) { return random_.uniform() < probability; }
  int whole(int low, int high) { return low + static_cast<int>(random_.uniform() * (high - low + 1)); }
  /// One of them, by their weights.
  template <class Choice>
  const Choice& pick(std::span<const Choice> choices) {
    double sum = 0;
    for (const Choice& c : choices) sum += c.weight;
    double left = random_.uniform() * sum;
    std::size_t i = 0;
    while (i + 1 < choices.size() && left >= choices[i].weight) left -= choices[i++].weight;
    return choices[i];
  }

  void set(const std::string& key, const std::string& value) { draw_.settings.push_back(key + "=" + value); }
  void set(const std::string& key, double value) { set(key, number(value)); }
  void set_uniform(const std::string& key, double low, double high) { set(key, uniform(low, high)); }
  void set_log_uniform(const std::string& key, double low, double high) { set(key, log_uniform(low, high)); }

 private:
  Draw& draw_;
  sim::Random random_;
};

/// Where a camera may fly.
struct FreeSpace {
  Vector3d low, high;
};

struct Place {
  const char* kind;
  double weight;
  FreeSpace free;      ///< above what stands there; the canyon's, of a stretch around its middle
  double speed, size;  ///< factors on those of a hall
  FreeSpace scanned;   ///< where the scanner goes
};
constexpr double kStreetFrom_m = 15, kStreetTo_m = 85;  // the canyon's stretch lies between
const std::array<Place, 3> kPlaces{
    {{"hall", 0.4, {{1.2, 1.2, 0.85}, {5.2, 4.8, 2.4}}, 1, 1, {{1.5, 1.5, 0.8}, {5, 4.5, 2.2}}},
     {"courtyard", 0.3, {{-4.5, -4.5, 2.3}, {4.5, 4.5, 6.5}}, 1.8, 2, {{-3.5, -3, 2.3}, {3.5, 3, 3.7}}},
     {"canyon", 0.3, {{-10, -1.7, 1.2}, {10, 1.7, 6}}, 2, 2, {{-10, -1.5, 2.2}, {10, 1.5, 4.2}}}}};

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
constexpr double kMovers = 0.25;    // share

struct Choice {
  const char* word;
  double weight;
};

struct Chip {
  const char* preset;
  double weight;
  int width, height;
};
constexpr std::array<Chip, 3> kChips{
    {{"dvxplorer", 0.5, 640, 480}, {"imx636", 0.4, 1280, 720}, {"davis346", 0.1, 346, 260}}};
constexpr Chip kQuickChip{"dvxplorer", 1, 320, 240};

/// What the parts of a draw tell each other.
struct Plan {
  Place place;
  double duration_s;
  bool quick, night = false, movers = false, landing = false;
  double street_x_m = 0;
  const Chip* chip = &kQuickChip;
};

void draw_movers(Drawer& d, Plan& plan, Draw& out) {
  if (!d.chance(kMovers)) return;
  plan.movers = true;
  const bool hall = std::string_view(plan.place.kind) == "hall";
  const std::array<Choice, 3> things{{{"people", 0.5}, {"fans", 0.25}, {"cars", hall ? 0 : 0.25}}};
  const Choice& thing = d.pick<Choice>(things);
  const int count = std::string_view(thing.word) == "people" ? d.whole(1, 2) : 1;
  d.set(text("world.movers.", thing.word), count);
  out.scene += text(", ", thing.word);
}

void draw_world(Drawer& d, Plan& plan, Draw& out) {
  out.scene = plan.place.kind;
  d.set("world.kind", plan.place.kind);
  const double contrast = d.uniform(0.4, 1.4);
  d.set("world.texture_contrast", contrast);
  out.scene += text(", texture ", number(contrast, 2));
  draw_movers(d, plan, out);
}

void draw_lamp_changes(Drawer& d, const Plan& plan, Draw& out) {
  if (d.chance(0.2)) {
    d.set("lamps.flicker_hz", d.chance(0.5) ? 100 : 120);
    d.set_log_uniform("lamps.flicker_depth", 0.03, 0.25);
    out.light += ", flicker";
  }
  if (!d.chance(0.1)) return;
  const double off_s = d.uniform(0.4, 0.7) * plan.duration_s;
  d.set("lamps.off_at_s", off_s);
  if (d.chance(0.5)) d.set("lamps.on_at_s", off_s + d.uniform(0.1, 0.25) * plan.duration_s);
  d.set_log_uniform("lamps.off_factor", 0.02, 0.5);
  d.set_log_uniform("lamps.fade_ms", 2, 50);
  out.light += ", step";
}

void draw_light(Drawer& d, Plan& plan, Draw& out) {
  if (std::string_view(plan.place.kind) == "hall") {
    const double lux = d.log_uniform(100, 1000);
    d.set("world.lamp_lux", lux);
    d.set_log_uniform("world.window_cd_m2", 300, 6000);
    out.light = text("lamps, ", number(lux, 2), " lux");
    return draw_lamp_changes(d, plan, out);
  }
  plan.night = d.chance(0.08);
  if (plan.night) {
    d.set("world.night", "true");
    const double lux = d.log_uniform(300, 3000);  // a twentieth of it below a street lamp
    d.set("world.lamp_lux", lux);
    out.light = text("street lamps, ", number(0.05 * lux, 2), " lux");
    return draw_lamp_changes(d, plan, out);
  }
  const bool sun = d.chance(0.75);
  const double lux = sun ? d.log_uniform(10000, 100000) : 0;
  d.set("world.sun_lux", lux);
  d.set_uniform("world.sun_azimuth_deg", 0, 360);
  d.set_uniform("world.sun_elevation_deg", 15, 70);
  const double sky = sun ? lux * d.uniform(0.1, 0.4) : d.log_uniform(3000, 20000);
  d.set("world.sky_lux", sky);
  out.light = sun ? text("sun, ", number(lux + sky, 2), " lux") : text("overcast, ", number(sky, 2), " lux");
}

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

void draw_vibration(Drawer& d) {
  if (!d.chance(0.4)) return;
  d.set_log_uniform("trajectory.vibration_mm", 0.03, 0.4);
  d.set_log_uniform("trajectory.vibration_deg", 0.005, 0.05);
  d.set_uniform("trajectory.vibration_hz", 20, 150);
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

void draw_camera(Drawer& d, Plan& plan, Draw& out) {
  if (!plan.quick) plan.chip = &d.pick<Chip>(kChips);
  const int width = plan.chip->width, height = plan.chip->height;
  const bool wide = d.chance(0.5);
  const double across_deg = wide ? d.uniform(86, 94) : d.uniform(58, 70);
  double k1 = 0, k2 = 0;
  if (!d.chance(0.2)) {
    k1 = wide ? d.uniform(-0.14, -0.05) : d.uniform(-0.2, 0.05);
    k2 = wide ? d.uniform(0.01, 0.025) : d.uniform(0, 0.06);
  }
  const double radius = std::tan(0.5 * kDegree * across_deg), square = radius * radius;
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

void draw_events(Drawer& d, const Plan& plan, Draw& out) {
  const double on = d.log_uniform(0.15, 0.4);
  d.set("events.threshold_on", on);
  d.set("events.threshold_off", on * d.uniform(0.8, 1.25));
  out.sensors = text("threshold ", number(on, 2));
  if (d.chance(0.5)) {
    d.set("events.preset", plan.chip->preset);
    out.sensors = text(plan.chip->preset, ", ", out.sensors);
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

void draw_imu(Drawer& d, Draw& out) {
  const char* preset = d.chance(0.6) ? "pixhawk" : "adis";
  constexpr std::array<Choice, 3> kRates{{{"200", 0.5}, {"400", 0.3}, {"1000", 0.2}}};
  const char* rate = d.pick<Choice>(kRates).word;
  d.set("imu.preset", preset);
  d.set("imu.rate_hz", rate);
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

/// Sigmas from half of an ordinary calibration's to all of it.
void draw_calibration(Drawer& d, Draw& out) {
  const double share = d.uniform(0.5, 1);
  const std::array<std::pair<const char*, double>, 9> ordinary{{{"focal_sigma", 0.003},
                                                                {"centre_sigma_px", 1},
                                                                {"k1_sigma", 0.01},
                                                                {"k2_sigma", 0.02},
                                                                {"p1_sigma", 5e-4},
                                                                {"p2_sigma", 5e-4},
                                                                {"rotation_sigma_deg", 0.3},
                                                                {"translation_sigma_mm", 10},
                                                                {"time_sigma_ms", 2}}};
  for (const auto& [key, sigma] : ordinary) d.set(text("handed_over.", key), share * sigma);
  out.calibration = text("errors of ", number(share, 2), " of an ordinary one's");
}

}  // namespace

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
  Plan plan{kind.pick<Place>(kPlaces), quick ? 1 : 0.1 * kind.whole(20, 40), quick};
  if (std::string_view(plan.place.kind) == "canyon")
    plan.street_x_m = kind.uniform(kStreetFrom_m, kStreetTo_m);
  kind.set("duration_s", plan.duration_s);
  Drawer world = part(Part::world), light = part(Part::light), motion = part(Part::motion),
         camera = part(Part::camera), events = part(Part::events), imu = part(Part::imu),
         calibration = part(Part::calibration), map = part(Part::map);
  draw_world(world, plan, out);
  draw_light(light, plan, out);
  draw_motion(motion, plan, out);
  draw_camera(camera, plan, out);
  draw_events(events, plan, out);
  draw_imu(imu, out);
  draw_map(map, plan, out);
  draw_map_faults(map, out);
  draw_calibration(calibration, out);
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
