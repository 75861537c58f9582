// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>

#include "evpose/core/error.h"
#include "evpose/sim/world/material_shelf.h"
#include "evpose/sim/world/mesh_builder.h"
#include "evpose/sim/world/random.h"
#include "evpose/sim/world/worlds.h"

namespace evpose::sim {

/// A world while it is being laid out.
struct WorldDraft {
  const WorldConfig& config;
  Scene scene;
  MaterialShelf materials;
  Random random;

  explicit WorldDraft(const WorldConfig& c) : config(c) {}

  std::int32_t add_object(const std::string& name);
  /// A number for a pattern.
  std::uint64_t seed() { return random.bits(); }
  /// The material with its texture beginning anywhere.
  Finish finish(std::int32_t material, std::int32_t object);
  bool chance(double share) { return random.uniform() < share; }
  /// A whole number in [low, high].
  int pick(int low, int high) { return low + static_cast<int>(random.uniform() * (high - low + 1)); }
};

/// Where a thing stands: its frame has x to the right, y to the back, z up; it is seen from -y. What leans on
/// a wall has its back at y = 0.
struct Place {
  Pose T_map_thing;
  Place(const Eigen::Vector3d& foot, double yaw)
      : T_map_thing{so3::exp(yaw * Eigen::Vector3d::UnitZ()), foot} {}
  explicit Place(const Pose& pose) : T_map_thing(pose) {}
};

/// A box between two corners of the thing's frame.
void put_box(WorldDraft& draft, const Place& place, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
             const Finish& finish, unsigned sides = all_sides);
/// A sheet of `width` x `height` on an upright front that looks to -y at `y`, its lower left corner at (x,
/// z).
struct SheetOn {
  double x, y, z, width, height;
};
void put_sheet(WorldDraft& draft, const Place& place, const SheetOn& sheet, const Finish& finish);
/// An upright round post.
struct Post {
  double radius_m, height_m;
  int facets = 32;
};
void put_post(WorldDraft& draft, const Eigen::Vector3d& foot, const Post& post, const Finish& finish,
              bool lids = true);

/// By the config's kind. Errors: moving things that the world has no room for.
Status lay_out_world(WorldDraft& draft);
void lay_out_hall(WorldDraft& draft);
void lay_out_courtyard(WorldDraft& draft);
void lay_out_canyon(WorldDraft& draft);
/// Sun and sky by the config, as by day or night.
void add_daylight(WorldDraft& draft);
/// Lux from all lamps on a level face at the point, nothing in the way.
double lamp_lux_at(const Scene& scene, const Eigen::Vector3d& point);

}  // namespace evpose::sim
