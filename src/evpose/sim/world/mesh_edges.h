// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// A chain of mesh edges between the same two surfaces, without a sharp bend.
struct EdgeChain {
  std::vector<Eigen::Vector3d> points;  ///< metres; a closed chain repeats the first at the end
};

/// A mesh segmented into flat or smooth surfaces and the edges that bound them.
struct MeshEdges {
  std::vector<std::int32_t> surface_of;  ///< of each triangle: connected and without a crease
  std::vector<EdgeChain>
      chains;  ///< creases of more than `crease_rad`, rims, intersections with other bodies
};
MeshEdges find_edges(const Mesh& mesh, double crease_rad);

}  // namespace evpose::sim
