// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "evpose/map_build/line_segment.h"
#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/planes.h"

namespace evpose::map_build {

/// Calls visit(number, d, off) for the points around a line and a few more: `d` from a place on the line
/// nearby, `off` from the line itself. Looks into balls in a row, each for its own share of the line.
template <class Visit>
void for_points_along(const SurfacePoints& surface, const Neighbours& tree, const Eigen::Vector3d& begin,
                      const Eigen::Vector3d& end, double reach_m, const Visit& visit) {
  const double length = (end - begin).norm();
  const Eigen::Vector3d along = (end - begin) / length;
  const int balls = std::max(1, static_cast<int>(std::ceil(length / reach_m)));
  const double half = 0.5 * length / balls;
  const auto radius = static_cast<float>(std::hypot(half, reach_m));
  std::vector<std::uint32_t> near;
  for (int k = 0; k < balls; ++k) {
    const Eigen::Vector3d centre = begin + (2 * k + 1) * half * along;
    tree.within(centre.cast<float>(), radius, near);
    for (const std::uint32_t i : near) {
      const Eigen::Vector3d d = surface.position[i].cast<double>() - centre;
      const double t = along.dot(d);
      if (t >= -half && t < half) visit(i, d, Eigen::Vector3d(d - t * along));
    }
  }
}

/// All points of the cloud within `reach_m` of a line, whatever plane they are of, relative to the anchor.
std::vector<Eigen::Vector3d> points_around(const SurfacePoints& surface, const Neighbours& tree,
                                           const Eigen::Vector3d& begin, const Eigen::Vector3d& end,
                                           double reach_m);

/// The part of a face beside an edge that tells where the face is there.
struct StripPlace {
  Eigen::Vector3d begin, end;  ///< of the edge
  Eigen::Vector3d inwards;     ///< unit, in the face, across the edge
  const FittedPlane& plane;    ///< of the face
  const FittedPlane& other;    ///< of the other face: its points beside the edge have no part
  double sine;                 ///< of the angle between the two
  double spacing_m;            ///< of the points
};

/// How a surface runs beside an edge, relative to its plane: height = offset + slope (t - middle).
struct StripFit {
  double offset_m = 0, slope = 0;
  double sigma_m = 0;  ///< of the height, with what is left of the scatter along the edge
};

/// Distance from the edge that fit_strip looks at points within.
double strip_reach_m(double noise_m, double sine, double spacing_m);

/// Walls carry skirtings, floors sag, scans are registered to a centimetre: a face need not lie in its plane
/// where the edge is. The height at which the points beside the edge lie is sought in a window around itself,
/// so that neither the plane's gate nor layers behind draw it. The result is the mean over two cases, that
/// the face is in its plane and that it is anywhere near, weighed by how well each explains the height; both
/// cases' spread is in sigma.
StripFit fit_strip(const std::vector<Eigen::Vector3d>& around, const StripPlace& place, double noise_m);

/// Two upright faces, and past an end of the crease one of them goes on to both sides: furniture stands
/// before a wall. Whether it touches the wall is open, and a gap of 2 cm has another edge. Reaches: how far a
/// point of each face may be from where the face is.
bool stands_before(const Neighbours& tree, const LineSegment& crease, double reach_a_m, double reach_b_m);

}  // namespace evpose::map_build
