// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>

#include "evpose/map_build/line_segment.h"
#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/planes.h"
#include "evpose/map_build/view_points.h"

namespace evpose::map_build {

/// What lies in and before a plane beyond a segment along which it may end. Probes most of a segment's
/// length.
class BeyondEdge {
 public:
  /// Keeps references.
  BeyondEdge(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
             std::span<const View> views);

  /// Points in the plane beyond the edge: it is none, only a change of density or of the plane's number.
  bool surface_continues(const LineSegment& edge) const;

  /// Something stands before the plane beyond the edge, on the side that the plane was seen from: the surface
  /// is not over there, it is merely hidden. Only told of planes that have nearly everything on one side,
  /// like walls.
  bool something_stands_before(const LineSegment& edge) const;

  /// Nobody could see whether the surface goes on beyond the edge: something stands before it. False where
  /// there are no views.
  bool hidden_from_views(const LineSegment& edge) const;

  /// Radius of a probe: the plane has a point within it where it has a surface.
  double reach_m() const { return std::max(2.5 * plane_.spacing_m, 2 * noise_m_); }

 private:
  /// A place beside the edge, at a share of its length, so far out of the surface.
  static Eigen::Vector3d probe(const LineSegment& edge, double share, double out_m) {
    return edge.begin + (edge.end - edge.begin) * share + out_m * edge.normal_a;
  }

  const Neighbours& tree_;
  const FittedPlane& plane_;
  std::span<const View> views_;
  double noise_m_;    ///< of the plane's points
  double free_side_;  ///< of the plane: +1 or -1 where nearly everything else lies, 0 if there is none
};

}  // namespace evpose::map_build
