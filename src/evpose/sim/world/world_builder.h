// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>

#include "evpose/core/error.h"
#include "evpose/sim/world/material_library.h"
#include "evpose/sim/world/mesh_builder.h"
#include "evpose/sim/world/random.h"
#include "evpose/sim/world/worlds.h"

namespace evpose::sim {

/// A world under construction.
struct WorldBuilder {
  const WorldConfig& config;
  Scene scene;
  MaterialLibrary materials;
  Random random;

  explicit WorldBuilder(const WorldConfig& c) : config(c) {}

  std::int32_t add_object(const std::string& name);
  /// An object that people move about.
  std::int32_t add_furniture(const std::string& name);
  /// Seed for a pattern.
  std::uint64_t seed() { return random.bits(); }
  /// The material with a random texture offset.
  Finish finish(std::int32_t material, std::int32_t object);
  bool chance(double probability) { return random.uniform() < probability; }
  /// A random integer in [low, high].
  int pick(int low, int high) { return low + static_cast<int>(random.uniform() * (high - low + 1)); }
};

/// Pose of an object: in its frame x points right, y backwards, z up, and its front faces -y. Objects against
/// a wall have their back at y = 0.
struct Placement {
  Pose T_map_object;
  Placement(const Eigen::Vector3d& foot, double yaw)
      : T_map_object{so3::exp(yaw * Eigen::Vector3d::UnitZ()), foot} {}
  explicit Placement(const Pose& pose) : T_map_object(pose) {}
};

/// A box between two corners in the frame of the object.
void put_box(WorldBuilder& builder, const Placement& place, const Eigen::Vector3d& low,
             const Eigen::Vector3d& high, const Finish& finish, unsigned sides = all_sides);
/// A sheet of `width` x `height` on an upright front that faces -y at `y`, its lower left corner at (x,
/// z).
struct SheetOn {
  double x, y, z, width, height;
};
void put_sheet(WorldBuilder& builder, const Placement& place, const SheetOn& sheet, const Finish& finish);
/// An upright round post.
struct Post {
  double radius_m, height_m;
  int facets = 32;
};
void put_post(WorldBuilder& builder, const Eigen::Vector3d& foot, const Post& post, const Finish& finish,
              bool lids = true);

/// By the kind of the config. Errors: moving objects for which the world has no room.
Status build_world(WorldBuilder& builder);
void build_hall(WorldBuilder& builder);
void build_courtyard(WorldBuilder& builder);
void build_canyon(WorldBuilder& builder);
/// Sun and sky by the config, as by day or night.
void add_daylight(WorldBuilder& builder);
/// Illuminance by all lamps on a horizontal face at the point, without occlusion, lux.
double lamp_lux_at(const Scene& scene, const Eigen::Vector3d& point);

}  // namespace evpose::sim
