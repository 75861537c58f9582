// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/map_builder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/map/triangulation.h"

namespace evpose::map_build {
namespace {

const Error kGivenUp{"map build", "interrupted", "nothing was written"};

/// Points at exactly the same place say the same; returns how many were removed.
std::size_t remove_duplicates(PointCloud& cloud) {
  std::vector<std::uint32_t> order(cloud.points.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto before = [&](std::uint32_t a, std::uint32_t b) {
    const Eigen::Vector3f &p = cloud.points[a], &q = cloud.points[b];
    if (p.x() != q.x()) return p.x() < q.x();
    if (p.y() != q.y()) return p.y() < q.y();
    if (p.z() != q.z()) return p.z() < q.z();
    return a < b;
  };
  std::sort(order.begin(), order.end(), before);
  std::vector<bool> doubled(cloud.points.size(), false);
  std::size_t removed = 0;
  for (std::size_t k = 1; k < order.size(); ++k)
    if (cloud.points[order[k]] == cloud.points[order[k - 1]]) doubled[order[k]] = true, ++removed;
  if (removed == 0) return 0;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (doubled[i]) continue;
    cloud.points[kept] = cloud.points[i];
    if (!cloud.brightness.empty()) cloud.brightness[kept] = cloud.brightness[i];
    ++kept;
  }
  cloud.points.resize(kept);
  if (!cloud.brightness.empty()) cloud.brightness.resize(kept);
  return removed;
}

void add_points(const Piece& piece, std::int32_t number, double spacing_m, ContourMap& map) {
  const int count = std::max(1, static_cast<int>(std::lround(piece.length_m() / spacing_m)));
  ContourPoint p;
  p.normal = piece.normal_a.cast<float>();
  p.normal_b = piece.normal_b.cast<float>();
  p.tangent = piece.tangent().cast<float>();
  p.length = static_cast<float>(piece.length_m() / count);
  p.sigma = static_cast<float>(piece.sigma_m);
  p.contour = number;
  p.plane_a = piece.plane_a;
  p.plane_b = piece.plane_b;
  p.kind = piece.kind;
  for (int k = 0; k < count; ++k) {
    p.position = (piece.begin + (piece.end - piece.begin) * ((k + 0.5) / count)).cast<float>();
    map.points.push_back(p);
  }
}

/// Corners of outlines near fitted contours go onto these, so that the surface ends where its contour is.
Eigen::Vector3d drawn_to_contours(const Eigen::Vector3d& corner, const std::vector<Piece>& pieces,
                                  double reach_m) {
  const Piece* nearest = nullptr;
  double least = reach_m;
  for (const Piece& piece : pieces)
    if (const double d = distance(piece, corner); d < least) least = d, nearest = &piece;
  if (nearest == nullptr) return corner;
  const Eigen::Vector3d t = nearest->tangent();
  Eigen::Vector3d out = nearest->begin + t * t.dot(corner - nearest->begin);
  // A corner of two contours: go along the first to the second.
  const Piece* second = nullptr;
  least = reach_m;
  for (const Piece& piece : pieces) {
    if (&piece == nearest || std::abs(piece.tangent().dot(t)) > 0.8) continue;
    if (const double d = distance(piece, out); d < least) least = d, second = &piece;
  }
  if (second == nullptr) return out;
  const Eigen::Vector3d s = second->tangent(), w = out - second->begin;
  const double c = s.dot(t);
  return out + t * ((c * s.dot(w) - t.dot(w)) / (1 - c * c));
}

void add_polygons(const FittedPlane& plane, std::int32_t number, const Outline& outline,
                  const std::vector<Piece>& pieces, double noise_m, ContourMap& map) {
  const PlaneFrame frame(plane);
  const auto first = static_cast<std::int32_t>(map.polygons.size());
  for (const Ring& ring : outline.rings) {
    MapPolygon polygon;
    polygon.plane = number;
    polygon.hole_of = ring.hole_of < 0 ? -1 : first + ring.hole_of;
    for (const auto& corner : ring.corners)
      polygon.vertices.push_back(
          drawn_to_contours(frame.lift(corner), pieces, 1.5 * outline.cell_m + 2 * noise_m).cast<float>());
    map.polygons.push_back(std::move(polygon));
  }
}

/// Rms of the plane that half of the points lie on smoother planes than.
double typical_roughness(const Planes& planes) {
  std::vector<std::pair<double, std::size_t>> by_roughness;
  std::size_t all = 0, so_far = 0;
  for (const FittedPlane& plane : planes.planes) {
    by_roughness.emplace_back(plane.rms_m, plane.points.size());
    all += plane.points.size();
  }
  std::sort(by_roughness.begin(), by_roughness.end());
  for (const auto& [rms, points] : by_roughness)
    if (2 * (so_far += points) >= all) return rms;
  return 0;
}

}  // namespace

void describe(ConfigTable& table, BuildConfig& c) {
  table.add("normal_sigma", c.patch.normal_sigma_rad, "rad", "to which a patch's normal must be known",
            {0.001, 0.5});
  table.add("most_neighbours", c.patch.most, "", "points of a patch", {12, 1000});
  table.add("plane_angle", c.plane.angle_rad, "rad", "most between a point's normal and its plane",
            {0.01, 1});
  table.add("plane_gate", c.plane.gate_sigma, "", "most distance from a plane, in units of the noise",
            {1, 10});
  table.add("plane_patches", c.plane.least_patches, "",
            "least points of a plane, in patches that tell a normal", {1, 1e6});
  table.add("plane_rough", c.plane.most_rough, "",
            "roughest plane that has contours, in units of the typical rms", {1, 100});
  table.add("plane_tilt", c.plane.most_tilt_rad, "rad",
            "most error of the direction of a plane with contours", {0.0001, 1});
  table.add("crease_angle", c.crease.least_angle_rad, "rad", "least between two planes that make a crease",
            {0.05, 1.5});
  table.add("crease_length", c.crease.least_length_m, "m", "least of a crease", {0, 10});
  table.add("boundary_length", c.boundary.least_length_m, "m", "least of a free boundary", {0, 10});
  table.add("boundary_sigma", c.boundary.most_sigma_m, "m", "most error of a free boundary", {0, 1});
  table.add("point_spacing", c.point_spacing_m, "m", "of the contours' points", {0.001, 1});
}

Expected<BuiltMap> build_map(PointCloud cloud, const BuildConfig& config, ThreadPool& pool,
                             const std::function<bool(double)>& progress) {
  BuiltMap out;
  ContourMap& map = out.map;
  BuildFigures& figures = out.figures;
  map.anchor = cloud.anchor;
  map.source = cloud.source;
  figures.points = cloud.points.size();
  figures.duplicates = remove_duplicates(cloud);
  const auto scale = measure_scale(cloud.points, config.patch, cloud.source);
  if (!scale) return scale.error();
  figures.scale = *scale;
  if (!progress(0.1)) return kGivenUp;
  const SurfacePoints surface = describe_surface(std::move(cloud.points), *scale, config.patch, pool);
  if (!progress(0.6)) return kGivenUp;
  const Planes planes = find_planes(surface, config.plane);
  if (planes.planes.empty()) return Error{cloud.source, "no plane has enough points", "give a denser cloud"};
  if (!progress(0.8)) return kGivenUp;
  const std::vector<bool> curved = find_curved(surface, planes);
  std::vector<bool> unfit = curved;  // for contours: bent, or a mixture of surfaces
  const double roughest_m = config.plane.most_rough * typical_roughness(planes);
  for (std::size_t p = 0; p < unfit.size(); ++p)
    unfit[p] = unfit[p] || planes.planes[p].rms_m > roughest_m ||
               planes.planes[p].tilt_sigma_rad() > config.plane.most_tilt_rad;
  const Neighbours tree(surface.position);
  const std::vector<Piece> creases = find_creases(surface, tree, planes, unfit, config.crease, pool);
  if (!progress(0.85)) return kGivenUp;
  std::vector<std::vector<Piece>> pieces(planes.planes.size());
  for (const Piece& piece : creases)
    for (const std::int32_t plane : {piece.plane_a, piece.plane_b})
      pieces[static_cast<std::size_t>(plane)].push_back(piece);
  std::vector<Outline> outlines(planes.planes.size());
  std::vector<Boundaries> boundaries(planes.planes.size());
  pool.for_chunks(planes.planes.size(), 1, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      outlines[p] = trace_outline(surface, planes.planes[p]);
      if (unfit[p]) continue;
      boundaries[p] = find_boundaries(surface, tree, planes.planes[p], static_cast<std::int32_t>(p),
                                      outlines[p], pieces[p], config.boundary);
    }
  });
  if (!progress(0.95)) return kGivenUp;
  std::int32_t number = 0;
  for (const Piece& piece : creases) {
    add_points(piece, number++, config.point_spacing_m, map);
    figures.crease_m += piece.length_m();
  }
  for (std::size_t p = 0; p < planes.planes.size(); ++p) {
    const FittedPlane& plane = planes.planes[p];
    for (const Piece& piece : boundaries[p].pieces) {
      add_points(piece, number++, config.point_spacing_m, map);
      figures.boundary_m += piece.length_m();
    }
    figures.shadow_m += boundaries[p].shadow_m;
    figures.in_planes += plane.points.size();
    figures.curved += curved[p] ? 1 : 0;
    pieces[p].insert(pieces[p].end(), boundaries[p].pieces.begin(), boundaries[p].pieces.end());
    add_polygons(plane, static_cast<std::int32_t>(p), outlines[p], pieces[p], scale->noise_m, map);
    map.planes.push_back({plane.normal.cast<float>(), plane.d,
                          static_cast<std::uint32_t>(plane.points.size()), static_cast<float>(plane.rms_m)});
  }
  figures.planes = map.planes.size();
  if (map.points.empty())
    return Error{cloud.source, text("no contour among ", figures.planes, " planes"),
                 "give a larger or denser cloud"};
  map.occluders = triangulated(map.planes, map.polygons);
  return out;
}

}  // namespace evpose::map_build
