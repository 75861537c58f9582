// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "evpose/map/contour_map.h"

namespace evpose::map_build {

/// A straight segment of contour, relative to the cloud's anchor, metres.
struct LineSegment {
  ContourKind kind = ContourKind::unknown;
  std::int32_t plane_a = -1, plane_b = -1;
  Eigen::Vector3d begin = Eigen::Vector3d::Zero(), end = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal_a = Eigen::Vector3d::Zero();  ///< in plane a, across, out of its surface; unit
  Eigen::Vector3d normal_b = Eigen::Vector3d::Zero();  ///< the same of plane b; zero if there is none
  double sigma_m = 0;                                  ///< across the contour, 1 sigma
  bool doubtful = false;  ///< there are edges near by, and none here: no contour of the map
  std::int32_t chain =
      -1;  ///< segments of one curve, in their order, have the same; -1: a segment of its own

  double length_m() const { return (end - begin).norm(); }
  Eigen::Vector3d tangent() const { return (end - begin).normalized(); }
};

/// Distance of x from a segment.
inline double distance(const LineSegment& segment, const Eigen::Vector3d& x) {
  const Eigen::Vector3d along = segment.end - segment.begin;
  const double t = along.dot(x - segment.begin) / along.squaredNorm();
  return (x - segment.begin - (t < 0 ? 0 : t > 1 ? 1 : t) * along).norm();
}

}  // namespace evpose::map_build
