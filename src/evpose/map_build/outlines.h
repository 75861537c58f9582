// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/map_build/planes.h"

namespace evpose::map_build {

/// A frame in a plane: x = origin + u first + v second.
struct PlaneFrame {
  Eigen::Vector3d origin, first, second;  ///< `first`, `second`, normal are a right-handed triad

  explicit PlaneFrame(const FittedPlane& plane);
  Eigen::Vector2d flat(const Eigen::Vector3d& x) const {
    return {first.dot(x - origin), second.dot(x - origin)};
  }
  Eigen::Vector3d lift(const Eigen::Vector2d& p) const { return origin + p.x() * first + p.y() * second; }
};

/// A closed line around a plane's points or around a hole in them; the surface is on its left.
struct Ring {
  std::vector<Eigen::Vector2d> corners;  ///< not repeated at the end
  std::vector<Eigen::Vector2d> coarse;   ///< the same line with fewer corners: sides long enough to be fitted
  std::vector<Eigen::Vector2d> steps;    ///< the same line from cell to cell
  int hole_of = -1;                      ///< ring of the same outline that it cuts, -1: outer
};

/// Boundary tracking to closed contours (EV-Pose, Map Construction): the plane's points fill the cells of a
/// grid as coarse as their spacing asks for; small holes are closed; rings follow the filled cells' edges and
/// are straightened to within a cell. `cell_m` is told back.
struct Outline {
  std::vector<Ring> rings;  ///< outer rings before their holes
  std::vector<Ring> solid;  ///< around what hides for certain: well covered by points, a cell within `rings`
  double cell_m = 0;
};
Outline trace_outline(const SurfacePoints& surface, const FittedPlane& plane);

/// Twice the area of a ring, positive counter-clockwise.
double twice_area(const std::vector<Eigen::Vector2d>& corners);

/// Keeps corners so that no dropped one is further than `tolerance` from the straight line that replaces it
/// (Douglas-Peucker on a closed line).
std::vector<Eigen::Vector2d> straightened(const std::vector<Eigen::Vector2d>& ring, double tolerance);

}  // namespace evpose::map_build
