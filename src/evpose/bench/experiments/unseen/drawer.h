// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>

#include "evpose/bench/experiments/unseen/draw.h"
#include "evpose/sim/world/random.h"

namespace evpose::experiments::unseen {

/// Each part of a draw has random numbers of its own: a change of one leaves the others as they were.
enum class Part : std::uint64_t {
  kind,
  world,
  light,
  motion,
  camera,
  events,
  imu,
  calibration,
  map,
  seeds,
  looks,
  filters,
  optics
};

/// A number with so many significant digits.
std::string number(double value, int digits = 4);

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
  Eigen::Vector3d low, high;
};

struct Place {
  const char* kind;
  double weight;
  FreeSpace free;      ///< above what stands there; the canyon's, of a stretch around its middle
  double speed, size;  ///< factors on those of a hall
  FreeSpace scanned;   ///< where the scanner goes
};

struct Choice {
  const char* word;
  double weight;
};

/// A chip with its own size.
struct Chip {
  const char* preset;  ///< of the simulator
  double weight;
  int width, height;  ///< px
};

/// What the parts of a draw tell each other.
struct Plan {
  Place place;
  double duration_s;
  bool quick;
  bool night = false, movers = false, landing = false;
  double street_x_m = 0;  ///< middle of the canyon's stretch
  Chip chip{};
  double edge_radius = 0;  ///< tangent of half the angle across
};

// Each draws one part: its settings, and what of it concerns the others. Place before light and motion, and
// these before sensors and map.

Place draw_place(Drawer& d);
/// Where the canyon's stretch lies, m along x.
double draw_street_x(Drawer& d);
void draw_world(Drawer& d, Plan& plan, Draw& out);
/// What deceives: windows all alike, mirrors; and the pad's mark.
void draw_looks(Drawer& d, const Plan& plan, Draw& out);
void draw_light(Drawer& d, Plan& plan, Draw& out);
void draw_motion(Drawer& d, Plan& plan, Draw& out);

}  // namespace evpose::experiments::unseen
