// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// Baked light of a patch: a grid of illuminance for each channel.
struct LightMap {
  Eigen::Vector3d right, up;   ///< unit, in the patch's plane
  double right0 = 0, up0 = 0;  ///< of the first texel's centre, metres along the axes
  double per_metre = 1;        ///< texels
  int columns = 0, rows = 0;   ///< 0: not baked
  std::vector<float> values;   ///< lux; channel by channel, row by row
};

/// Coplanar triangles with one material and one texture mapping: a pixel can be shaded from it without
/// knowing which triangle it sees.
struct Patch {
  Eigen::Vector3d normal;  ///< unit, part's frame
  double offset = 0;       ///< normal . p + offset = 0
  Eigen::Vector3d u_axis, v_axis;
  double u0 = 0, v0 = 0;  ///< texture coordinates: axis . p + 0
  std::int32_t material = 0, object = 0;
  /// Neighbouring patches without a step of normal, texture and material have one group (the facets of a
  /// pillar); those without a step of normal have one surface (prints in a wall). Unique over all parts of a
  /// scene.
  std::int32_t group = 0, surface = 0;
  LightMap light;
};

/// The patches of the mesh of a part.
struct PartSurfaces {
  std::vector<Patch> patches;
  std::vector<std::int32_t> patch_of;  ///< of each triangle
  /// Of each triangle, bit i: the edge from corner i to the next may be visible; the diagonal of a rectangle
  /// is not.
  std::vector<std::uint8_t> edges;
};

/// `first` is the first number for groups and surfaces; advanced by the count of triangles.
PartSurfaces segment_surfaces(const Mesh& mesh, std::int32_t& first);

}  // namespace evpose::sim
