// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/sim/ray_box.h"
#include "evpose/sim/texture.h"

namespace evpose::sim {

/// A solid box that stands upright, or the hollow one that is the room.
struct Box {
  Pose T_map_box;              ///< of its middle; turned about z only
  Eigen::Vector3d half;        ///< half extents, metres
  std::vector<Texture> faces;  ///< by BoxSide
};

/// Number of a face in the scene: six times the box plus the side.
using Face = int;
inline Face face_of(std::size_t box, BoxSide side) { return static_cast<Face>(6 * box) + side; }

struct SceneHit {
  double distance;  ///< in lengths of the ray's direction
  Face face;
  Eigen::Vector3d point;  ///< map frame, metres
};

/// Boxes in a box, one lamp and light from all sides. Map frame: z up, metres. boxes[0] is the room, seen
/// from inside.
struct Scene {
  std::vector<Box> boxes;
  Eigen::Vector3d lamp = Eigen::Vector3d::Zero();
  double lamp_power = 1;  ///< radiance of white paper that faces the lamp from one metre
  double ambient = 0.2;   ///< radiance of white paper without the lamp

  /// First surface along a ray; nothing if the ray starts outside of the room and misses it.
  std::optional<SceneHit> trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;
  /// Inside a box or outside of the room.
  bool solid(const Eigen::Vector3d& point) const;
  /// Unit, map frame, out of the solid.
  Eigen::Vector3d normal(Face face) const;
};

/// Axes of a face's texture: u runs level, v up (or along y on level faces).
inline int texture_u_axis(BoxSide side) { return axis_of(side) == 0 ? 1 : 0; }
inline int texture_v_axis(BoxSide side) { return axis_of(side) == 2 ? 1 : 2; }

/// A furnished room of 6 x 5 x 3 m with a corner at the origin: table, crates, shelf, cupboard, pillar, beam.
/// Boxes touch or stand apart, none cut each other. `seed` picks textures and tones, not shapes.
Scene make_box_room(std::uint64_t seed);

}  // namespace evpose::sim
