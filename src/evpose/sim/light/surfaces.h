// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// Light that falls on a patch, baked: a grid of illuminance for each channel.
struct LightMap {
  Eigen::Vector3d right, up;   ///< unit, in the patch's plane
  double right0 = 0, up0 = 0;  ///< of the first texel's centre, metres along the axes
  double per_metre = 1;        ///< texels
  int columns = 0, rows = 0;   ///< none: not baked
  std::vector<float> values;   ///< lux; channel by channel, row by row
};

/// Triangles of one plane and one material, with one mapping of texture: what a pixel can be shaded from
/// without asking which triangle it sees.
struct Patch {
  Eigen::Vector3d normal;  ///< unit, part's frame
  double offset = 0;       ///< normal . p + offset = 0
  Eigen::Vector3d u_axis, v_axis;
  double u0 = 0, v0 = 0;  ///< texture coordinates: axis . p + 0
  std::int32_t material = 0, object = 0;
  /// Patches that run on into each other without a step of normal, texture and material have one group (the
  /// facets of a pillar), and those without a step of normal one surface (prints in a wall). Unique over all
  /// parts of a scene.
  std::int32_t group = 0, surface = 0;
  LightMap light;
};

/// A part's mesh, ordered for shading.
struct PartSurfaces {
  std::vector<Patch> patches;
  std::vector<std::int32_t> patch_of;  ///< of each triangle
  /// Of each triangle, bit i: the edge from corner i to the next may be seen as an edge; the diagonal of a
  /// rectangle may not.
  std::vector<std::uint8_t> edges;
};

/// `first` is the first number for groups and surfaces; advanced.
PartSurfaces order_surfaces(const Mesh& mesh, std::int32_t& first);

}  // namespace evpose::sim
