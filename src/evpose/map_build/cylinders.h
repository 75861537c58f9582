// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "evpose/map_build/planes.h"

namespace evpose::map_build {

class Neighbours;

/// A round body, relative to the cloud's anchor: a column or pipe, or a pole too thin for its points to lie
/// on a surface. Its silhouette moves with the eye: the map holds its axis, which nothing is aligned to.
struct Cylinder {
  Eigen::Vector3d begin = Eigen::Vector3d::Zero(), end = Eigen::Vector3d::Zero();  ///< of the axis
  double radius_m = 0;  ///< of a pole: rms distance of its points from the axis
  double rms_m = 0;     ///< of the points across the surface; of a pole as the radius
  std::size_t points = 0;
  bool is_pole = false;

  double length_m() const { return (end - begin).norm(); }
};

/// Cylinders among the points that no flat plane holds: those of `curved` planes and of none. Each stands out
/// from what is around it, is longer than wide, and is covered by points along its length; all but poles over
/// an angle that tells the radius.
std::vector<Cylinder> find_cylinders(const SurfacePoints& surface, const Neighbours& tree,
                                     const Planes& planes, const std::vector<bool>& curved);

}  // namespace evpose::map_build
