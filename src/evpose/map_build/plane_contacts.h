// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <utility>

#include "evpose/map_build/planes.h"

namespace evpose::map_build {

/// Numbers of two planes, the lower first.
using PlanePair = std::pair<std::int32_t, std::int32_t>;

/// The points of two planes that lie beside each other.
struct Contact {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();  ///< of their places
  int count = 0;
};

/// Pairs of planes with points beside each other.
std::map<PlanePair, Contact> find_contacts(const SurfacePoints& surface, const Planes& planes);

/// A line in two planes.
struct Line {
  Eigen::Vector3d origin, direction;
  Eigen::Vector3d at(double t) const { return origin + t * direction; }
};

/// The line in which two planes meet; its origin is the point of both that lies nearest to `near`.
Line intersection(const FittedPlane& a, const FittedPlane& b, const Eigen::Vector3d& near);

/// Extent of a plane's points across a line, if they were spread evenly.
double width_across(const SurfacePoints& surface, const FittedPlane& plane, const Line& line);

/// Facets of a column, pipe or vault are no wider than this.
inline constexpr double kFacetWidth_m = 0.25;

}  // namespace evpose::map_build
