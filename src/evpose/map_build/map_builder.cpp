// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/map_builder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "evpose/core/config.h"
#include "evpose/core/log.h"
#include "evpose/core/parallel.h"
#include "evpose/map/triangulation.h"
#include "evpose/map_build/contrast.h"
#include "evpose/map_build/cylinders.h"
#include "evpose/map_build/tiles.h"
#include "evpose/map_build/view_points.h"

namespace evpose::map_build {
namespace {

constexpr double kWorstNoise_m = 0.15;  // of any scanner
using Clock = std::chrono::steady_clock;
double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

const Error kGivenUp{"map build", "interrupted", "nothing was written"};

void add_points(const Piece& piece, std::int32_t number, std::int8_t contrast, double spacing_m,
                ContourMap& map) {
  const int count = std::max(1, static_cast<int>(std::lround(piece.length_m() / spacing_m)));
  ContourPoint p;
  // Where the faces run uneven beside it, an edge is turned a little against its planes.
  const Eigen::Vector3d along = piece.tangent();
  const auto across = [&](const Eigen::Vector3d& normal) -> Eigen::Vector3f {
    const Eigen::Vector3d out = normal - along.dot(normal) * along;
    return out.norm() > 0.5 ? Eigen::Vector3f(out.normalized().cast<float>()) : Eigen::Vector3f::Zero();
  };
  p.normal = across(piece.normal_a);
  p.normal_b = across(piece.normal_b);
  p.tangent = along.cast<float>();
  p.length = static_cast<float>(piece.length_m() / count);
  p.sigma = static_cast<float>(piece.sigma_m);
  p.contour = number;
  p.plane_a = piece.plane_a;
  p.plane_b = piece.plane_b;
  p.kind = piece.kind;
  p.contrast = contrast;
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
  for (const Ring& ring : outline.solid) {
    MapPolygon polygon;
    polygon.plane = number;
    polygon.hole_of = ring.hole_of < 0 ? -1 : first + ring.hole_of;
    for (const auto& corner : ring.corners)
      polygon.vertices.push_back(
          drawn_to_contours(frame.lift(corner), pieces, 1.5 * outline.cell_m + 2 * noise_m).cast<float>());
    map.polygons.push_back(std::move(polygon));
  }
}

/// The axis of a round body, whose silhouette is as far from it as its radius.
Piece axis_of(const Cylinder& cylinder) {
  Piece out;
  out.kind = ContourKind::cylinder_axis;
  out.begin = cylinder.begin;
  out.end = cylinder.end;
  out.sigma_m = cylinder.radius_m;
  return out;
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
  table.add("noise", c.patch.noise_m, "m", "of a point across its surface, 1 sigma; 0: that of most patches",
            {0, 0.15});
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
  table.add("tile_points", c.tile_points, "", "of a cloud's tile", {1e4, 1e9});
  table.add("tile_overlap", c.tile_overlap_m, "m", "that tiles see of their neighbours", {0, 100});
}

namespace {

/// Finds what one tile holds and adds to the map what lies in its core.
Status build_tile(PointCloud cloud, const Tile& tile, const BuildConfig& config, ThreadPool& pool,
                  std::span<const View> views, const std::function<bool(double)>& progress, BuiltMap& out) {
  ContourMap& map = out.map;
  BuildFigures& figures = out.figures;
  figures.duplicates += put_in_order(cloud);
  const Neighbours tree(cloud.points);
  const auto scale = measure_scale(cloud.points, tree, config.patch, cloud.source);
  if (!scale) return scale.error();
  if (scale->noise_m > kWorstNoise_m && figures.scale.noise_m == 0)
    log_warning(text(cloud.source, ": noise of ", std::lround(1e3 * scale->noise_m),
                     " mm across the surfaces: are these centimetres? Metres are expected"));
  if (!progress(0.1)) return kGivenUp;
  const auto start = Clock::now();
  const SurfacePoints surface = describe_surface(std::move(cloud.points), tree, *scale, config.patch, pool);
  if (!progress(0.6)) return kGivenUp;
  const auto described = Clock::now();
  const Planes planes = find_planes(surface, config.plane);
  figures.normals_s += seconds(described - start);
  figures.planes_s += seconds(Clock::now() - described);
  if (planes.planes.empty()) return Error{cloud.source, "no plane has enough points", "give a denser cloud"};
  if (!progress(0.8)) return kGivenUp;
  const std::vector<bool> curved = find_curved(surface, planes);
  std::vector<bool> unfit = curved;  // for contours: bent, or a mixture of surfaces
  const double roughest_m = config.plane.most_rough * typical_roughness(planes);
  for (std::size_t p = 0; p < unfit.size(); ++p)
    unfit[p] = unfit[p] || planes.planes[p].rms_m > roughest_m ||
               planes.planes[p].tilt_sigma_rad() > config.plane.most_tilt_rad;
  const std::vector<Piece> creases = find_creases(surface, tree, planes, unfit, config.crease, pool);
  if (!progress(0.85)) return kGivenUp;
  std::vector<std::vector<Piece>> pieces(planes.planes.size());
  for (const Piece& piece : creases)
    for (const std::int32_t plane : {piece.plane_a, piece.plane_b})
      pieces[static_cast<std::size_t>(plane)].push_back(piece);
  std::vector<Outline> outlines(planes.planes.size());
  pool.for_chunks(planes.planes.size(), 1, [&](std::size_t p, std::size_t, std::size_t) {
    outlines[p] = trace_outline(surface, planes.planes[p]);
  });
  const std::vector<Boundaries> boundaries =
      find_boundaries({surface, tree, planes, unfit, outlines, pieces, views}, config.boundary, pool);
  if (!progress(0.95)) return kGivenUp;
  const std::vector<Cylinder> cylinders = find_cylinders(surface, tree, planes, curved);
  const auto first_plane = static_cast<std::int32_t>(map.planes.size());
  std::int32_t chain = -1;  // of the last piece
  const auto add = [&](const Piece& whole) {
    std::optional<Piece> piece = clipped(whole, tile);
    if (!piece) return;
    if (piece->plane_a >= 0) piece->plane_a += first_plane;
    if (piece->plane_b >= 0) piece->plane_b += first_plane;
    const bool goes_on = piece->chain >= 0 && piece->chain == chain && !map.points.empty() &&
                         map.points.back().plane_a == piece->plane_a;
    chain = piece->chain;
    const std::int32_t number = map.points.empty() ? 0 : map.points.back().contour + (goes_on ? 0 : 1);
    const std::int8_t contrast =
        cloud.brightness.empty() ? std::int8_t{0} : contrast_of(*piece, surface, tree, cloud.brightness);
    add_points(*piece, number, contrast, config.point_spacing_m, map);
    figures.by_kind_m[static_cast<std::size_t>(piece->kind)] += piece->length_m();
  };
  for (const Piece& piece : creases) add(piece);
  for (std::size_t p = 0; p < planes.planes.size(); ++p) {
    const FittedPlane& plane = planes.planes[p];
    for (const Piece& piece : boundaries[p].pieces) {
      add(piece);
      if (!is_view_dependent(piece.kind)) pieces[p].push_back(piece);
    }
    figures.left_out_m += boundaries[p].left_out_m;
    for (const std::uint32_t i : plane.points) figures.in_planes += tile.holds(surface.position[i]) ? 1 : 0;
    figures.curved += curved[p] ? 1 : 0;
    add_polygons(plane, first_plane + static_cast<std::int32_t>(p), outlines[p], pieces[p], scale->noise_m,
                 map);
    map.planes.push_back({plane.normal.cast<float>(), plane.d,
                          static_cast<std::uint32_t>(plane.points.size()), static_cast<float>(plane.rms_m)});
  }
  for (const Cylinder& cylinder : cylinders) {
    add(axis_of(cylinder));
    const Eigen::Vector3f middle = (0.5 * (cylinder.begin + cylinder.end)).cast<float>();
    if (tile.holds(middle)) ++(cylinder.is_pole ? figures.poles : figures.cylinders);
  }
  figures.scale = *scale;
  return {};
}

}  // namespace

Expected<BuiltMap> build_map(PointCloud cloud, const BuildConfig& config, ThreadPool& pool,
                             const std::function<bool(double)>& progress) {
  BuiltMap out;
  ContourMap& map = out.map;
  map.anchor = cloud.anchor;
  map.source = cloud.source;
  out.figures.points = cloud.points.size();
  std::vector<View> views;
  for (const Eigen::Vector3d& eye : cloud.viewpoints) views.emplace_back(eye - cloud.anchor, cloud.points);
  const std::vector<Tile> tiles = cut_into_tiles(cloud.points, config.tile_points, config.tile_overlap_m);
  out.figures.tiles = tiles.size();
  std::optional<Error> barren;  // what a tile without planes said
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    bool given_up = false;
    const auto share = [&](double done) {
      given_up = !progress((static_cast<double>(k) + done) / static_cast<double>(tiles.size()));
      return !given_up;
    };
    PointCloud part;
    if (tiles.size() == 1)
      std::swap(part, cloud);
    else
      part = part_of(cloud, tiles[k]);
    if (!share(0)) return kGivenUp;
    if (const Status done = build_tile(std::move(part), tiles[k], config, pool, views, share, out); !done) {
      if (given_up) return kGivenUp;
      barren = done.error();
    }
  }
  out.figures.planes = map.planes.size();
  if (map.planes.empty() && barren) return *barren;
  if (std::all_of(map.points.begin(), map.points.end(),
                  [](const auto& p) { return is_view_dependent(p.kind); }))
    return Error{map.source, text("no contour among ", out.figures.planes, " planes"),
                 "give a larger or denser cloud"};
  map.occluders = triangulated(map.planes, map.polygons);
  return out;
}

}  // namespace evpose::map_build
