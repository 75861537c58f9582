// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/paper_map.h"

#include <cmath>

#include "evpose/core/parallel.h"
#include "evpose/map_build/contour_points.h"
#include "evpose/map_build/grown_regions.h"
#include "evpose/map_build/outlines.h"
#include "evpose/map_build/tiles.h"

namespace evpose::map_build {
namespace {

constexpr double kPointSpacing_m = 0.02;
const Error kGivenUp{"map build", "interrupted", "nothing was written"};

/// The traced line around a plane's points, as it is; `normal_a` out of the surface, which is on its left.
void add_contour(const FittedPlane& plane, const Ring& ring, const PlaneFrame& frame, double cell_m,
                 BuiltMap& out) {
  ContourMap& map = out.map;
  const std::int32_t number = map.points.empty() ? 0 : map.points.back().contour + 1;
  LineSegment side;
  side.kind = ContourKind::boundary;
  side.plane_a = static_cast<std::int32_t>(map.planes.size());
  // The line runs along the sides of cells, anywhere within the last one that has points.
  side.sigma_m = std::sqrt(cell_m * cell_m / 12 + plane.rms_m * plane.rms_m);
  for (std::size_t k = 0; k < ring.corners.size(); ++k) {
    side.begin = frame.lift(ring.corners[k]);
    side.end = frame.lift(ring.corners[(k + 1) % ring.corners.size()]);
    const Eigen::Vector2d along =
        (ring.corners[(k + 1) % ring.corners.size()] - ring.corners[k]).normalized();
    side.normal_a = along.y() * frame.first - along.x() * frame.second;
    add_points(side, number, 0, kPointSpacing_m, map);
    out.figures.by_kind_m[static_cast<std::size_t>(side.kind)] += side.length_m();
  }
}

/// The surface that hides what is behind it.
void add_surface(const Outline& outline, const PlaneFrame& frame, ContourMap& map) {
  const auto first = static_cast<std::int32_t>(map.polygons.size());
  for (const Ring& ring : outline.solid) {
    MapPolygon polygon;
    polygon.plane = static_cast<std::int32_t>(map.planes.size());
    polygon.hole_of = ring.hole_of < 0 ? -1 : first + ring.hole_of;
    for (const Eigen::Vector2d& corner : ring.corners)
      polygon.vertices.push_back(frame.lift(corner).cast<float>());
    map.polygons.push_back(std::move(polygon));
  }
}

}  // namespace

Expected<BuiltMap> build_paper_map(PointCloud cloud, ThreadPool& pool,
                                   const std::function<bool(double)>& progress) {
  BuiltMap out;
  out.map.anchor = cloud.anchor;
  out.map.source = cloud.source;
  out.figures.tiles = 1;
  out.figures.points = cloud.points.size();
  out.figures.duplicates = sort_and_deduplicate(cloud);
  const Neighbours tree(cloud.points);
  const auto scale = measure_scale(cloud.points, tree, {}, cloud.source);
  if (!scale) return scale.error();
  if (!progress(0.1)) return kGivenUp;
  const SurfacePoints surface = describe_by_neighbours(std::move(cloud.points), tree, *scale, pool);
  if (!progress(0.6)) return kGivenUp;
  const Planes planes = grow_regions(surface);
  if (planes.planes.empty()) return Error{cloud.source, "no plane has enough points", "give a denser cloud"};
  if (!progress(0.8)) return kGivenUp;
  for (const FittedPlane& plane : planes.planes) {
    const Outline outline = trace_outline(surface, plane);
    const PlaneFrame frame(plane);
    for (const Ring& ring : outline.rings) add_contour(plane, ring, frame, outline.cell_m, out);
    add_surface(outline, frame, out.map);
    out.map.planes.push_back({plane.normal.cast<float>(), plane.d,
                              static_cast<std::uint32_t>(plane.points.size()),
                              static_cast<float>(plane.rms_m)});
    out.figures.in_planes += plane.points.size();
  }
  out.figures.scale = surface.scale;
  out.figures.planes = out.map.planes.size();
  if (const Status done = complete_map(out.map); !done) return done.error();
  return out;
}

}  // namespace evpose::map_build
