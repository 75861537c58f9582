// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/sim/world/mesh_builder.h"

namespace evpose::sim {

struct MeshFileOptions {
  double scale = 1;                                ///< metres per unit of the file
  bool y_up = false;                               ///< the file's y is up, instead of z
  Eigen::Vector2d uv_m = Eigen::Vector2d::Zero();  ///< metres that the file's texture coordinates 0..1 span;
                                                   ///< zero: textures are laid on along the axes
  Finish finish;
};

/// Reads the triangles of an OBJ or PLY file. Its colours, images and material libraries are not read.
/// Errors: the file cannot be read, is no such mesh, has no triangle, a coordinate that is not finite or too
/// many triangles.
Expected<Mesh> read_mesh(const std::string& path, const MeshFileOptions& options);

}  // namespace evpose::sim
