// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// A run of a mesh's edges between the same two surfaces, without a sharp bend.
struct EdgeRun {
  std::vector<Eigen::Vector3d> points;  ///< metres; the first again at the end of a closed one
};

/// A mesh taken apart into flat or smooth surfaces and the edges that bound them.
struct MeshEdges {
  std::vector<std::int32_t> surface_of;  ///< of each triangle: connected and without a crease
  std::vector<EdgeRun> runs;             ///< creases of more than `crease_rad`, rims, cuts with other bodies
};
MeshEdges find_edges(const Mesh& mesh, double crease_rad);

}  // namespace evpose::sim
