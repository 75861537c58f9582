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
#include "evpose/core/thinned.h"
#include "evpose/map/triangulation.h"
#include "evpose/map_build/contour_points.h"
#include "evpose/map_build/contrast.h"
#include "evpose/map_build/curved_planes.h"
#include "evpose/map_build/cylinders.h"
#include "evpose/map_build/tiles.h"
#include "evpose/map_build/view_points.h"

namespace evpose::map_build {
namespace {

constexpr double kWorstNoise_m = 0.15;  // of any scanner
using Clock = std::chrono::steady_clock;
double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

const Error kGivenUp{"map build", "interrupted", "nothing was written"};

/// Corners of outlines near fitted contours go onto these, so that the surface ends where its contour is.
Eigen::Vector3d snapped_to_contours(const Eigen::Vector3d& corner, const std::vector<LineSegment>& segments,
                                    double reach_m) {
  const LineSegment* nearest = nullptr;
  double least = reach_m;
  for (const LineSegment& segment : segments)
    if (const double d = distance(segment, corner); d < least) least = d, nearest = &segment;
  if (nearest == nullptr) return corner;
  const Eigen::Vector3d t = nearest->tangent();
  Eigen::Vector3d out = nearest->begin + t * t.dot(corner - nearest->begin);
  // A corner of two contours: go along the first to the second.
  const LineSegment* second = nullptr;
  least = reach_m;
  for (const LineSegment& segment : segments) {
    if (&segment == nearest || std::abs(segment.tangent().dot(t)) > 0.8) continue;
    if (const double d = distance(segment, out); d < least) least = d, second = &segment;
  }
  if (second == nullptr) return out;
  const Eigen::Vector3d s = second->tangent(), w = out - second->begin;
  const double c = s.dot(t);
  return out + t * ((c * s.dot(w) - t.dot(w)) / (1 - c * c));
}

void add_polygons(const FittedPlane& plane, std::int32_t number, const Outline& outline,
                  const std::vector<LineSegment>& segments, double noise_m, ContourMap& map) {
  const PlaneFrame frame(plane);
  const auto first = static_cast<std::int32_t>(map.polygons.size());
  for (const Ring& ring : outline.solid) {
    MapPolygon polygon;
    polygon.plane = number;
    polygon.hole_of = ring.hole_of < 0 ? -1 : first + ring.hole_of;
    for (const auto& corner : ring.corners)
      polygon.vertices.push_back(
          snapped_to_contours(frame.lift(corner), segments, 1.5 * outline.cell_m + 2 * noise_m)
              .cast<float>());
    map.polygons.push_back(std::move(polygon));
  }
}

/// The axis of a round body, whose silhouette is as far from it as its radius.
LineSegment axis_of(const Cylinder& cylinder) {
  LineSegment out;
  out.kind = ContourKind::cylinder_axis;
  out.begin = cylinder.begin;
  out.end = cylinder.end;
  out.sigma_m = cylinder.radius_m;
  return out;
}

/// Rms of a plane if its noise were the cloud's.
double roughness(const SurfacePoints& surface, const FittedPlane& plane) {
  return plane.rms_m * (surface.scale.noise_m / noise_on(surface, plane));
}

/// Roughness of the plane that half of the points lie on smoother planes than.
double typical_roughness(const SurfacePoints& surface, const Planes& planes) {
  std::vector<std::pair<double, std::size_t>> by_roughness;
  std::size_t all = 0, so_far = 0;
  for (const FittedPlane& plane : planes.planes) {
    by_roughness.emplace_back(roughness(surface, plane), plane.points.size());
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

/// What a tile is made of, and the tools to work on it.
struct TileTask {
  const CloudTile& tile;
  const BuildConfig& config;
  ThreadPool& pool;
  std::span<const View> views;
  const std::function<bool(double)>& progress;
};

/// What was found in a tile.
struct TileContents {
  SurfacePoints surface;
  std::vector<std::uint8_t> brightness;  ///< of each surface point; empty: unknown
  Planes planes;
  std::vector<bool> curved, unfit;  ///< planes that bend, and that have no contours
  std::vector<LineSegment> creases;
  std::vector<std::vector<LineSegment>> edges_of;  ///< creases of each plane, later its boundaries as well
  std::vector<Outline> outlines;
  std::vector<Boundaries> boundaries;
  std::vector<Cylinder> cylinders;
};

/// Planes that bend or are a mixture of surfaces have no contours.
std::vector<bool> unfit_for_contours(const TileContents& found, const PlaneConfig& config) {
  std::vector<bool> unfit = found.curved;
  double typical_m = typical_roughness(found.surface, found.planes);
  // A single layer has no roughness; a surface of several has that of its steps.
  if (found.surface.scale.layered()) typical_m = std::max(typical_m, found.surface.scale.noise_m);
  const double roughest_m = config.most_rough * typical_m;
  for (std::size_t p = 0; p < unfit.size(); ++p)
    unfit[p] = unfit[p] || roughness(found.surface, found.planes.planes[p]) > roughest_m ||
               found.planes.planes[p].tilt_sigma_rad() > config.most_tilt_rad;
  return unfit;
}

/// Creases, outlines, boundaries and round bodies of the planes. False: given up.
bool find_contours(const TileTask& task, const Neighbours& tree, TileContents& found) {
  const SurfacePoints& surface = found.surface;
  const Planes& planes = found.planes;
  found.curved = find_curved(surface, planes);
  found.unfit = unfit_for_contours(found, task.config.plane);
  found.creases = find_creases(surface, tree, planes, found.unfit, task.config.crease, task.pool);
  if (!task.progress(0.85)) return false;
  found.edges_of.resize(planes.planes.size());
  for (const LineSegment& crease : found.creases)
    for (const std::int32_t plane : {crease.plane_a, crease.plane_b})
      found.edges_of[static_cast<std::size_t>(plane)].push_back(crease);
  found.outlines.resize(planes.planes.size());
  task.pool.for_chunks(planes.planes.size(), 1, [&](std::size_t p, std::size_t, std::size_t) {
    found.outlines[p] = trace_outline(surface, planes.planes[p]);
  });
  found.boundaries =
      find_boundaries({surface, tree, planes, found.unfit, found.outlines, found.edges_of, task.views},
                      task.config.boundary, task.pool);
  if (!task.progress(0.95)) return false;
  found.cylinders = find_cylinders(surface, tree, planes, found.curved);
  return true;
}

/// Adds to an empty map what lies in a tile's core.
class TileWriter {
 public:
  TileWriter(const TileTask& task, const Neighbours& tree, TileContents& found, BuiltMap& out)
      : task_(task), tree_(tree), found_(found), map_(out.map), figures_(out.figures) {}

  void add_all();

 private:
  void add(const LineSegment& whole);
  void add_plane(std::size_t p);

  const TileTask& task_;
  const Neighbours& tree_;
  TileContents& found_;
  ContourMap& map_;
  BuildFigures& figures_;
  std::int32_t chain_ = -1;  ///< of the last segment
};

void TileWriter::add(const LineSegment& whole) {
  std::optional<LineSegment> segment = clipped(whole, task_.tile);
  if (!segment) return;
  const bool same_curve = segment->chain >= 0 && segment->chain == chain_ && !map_.points.empty() &&
                          map_.points.back().plane_a == segment->plane_a;
  chain_ = segment->chain;
  const std::int32_t number = map_.points.empty() ? 0 : map_.points.back().contour + (same_curve ? 0 : 1);
  const std::int8_t contrast = found_.brightness.empty()
                                   ? std::int8_t{0}
                                   : contrast_of(*segment, found_.surface, tree_, found_.brightness);
  add_points(*segment, number, contrast, task_.config.point_spacing_m, map_);
  figures_.by_kind_m[static_cast<std::size_t>(segment->kind)] += segment->length_m();
}

/// A plane with its boundaries and the polygons that hide what is behind it.
void TileWriter::add_plane(std::size_t p) {
  const FittedPlane& plane = found_.planes.planes[p];
  for (const LineSegment& boundary : found_.boundaries[p].segments) {
    add(boundary);
    if (!is_view_dependent(boundary.kind)) found_.edges_of[p].push_back(boundary);
  }
  figures_.left_out_m += found_.boundaries[p].left_out_m;
  for (const std::uint32_t i : plane.points)
    figures_.in_planes += task_.tile.holds(found_.surface.position[i]) ? 1 : 0;
  figures_.curved += found_.curved[p] ? 1 : 0;
  add_polygons(plane, static_cast<std::int32_t>(p), found_.outlines[p], found_.edges_of[p],
               found_.surface.scale.noise_m, map_);
  map_.planes.push_back({plane.normal.cast<float>(), plane.d, static_cast<std::uint32_t>(plane.points.size()),
                         static_cast<float>(plane.rms_m)});
}

void TileWriter::add_all() {
  for (const LineSegment& crease : found_.creases) {
    if (crease.doubtful)
      figures_.left_out_m += crease.length_m();
    else
      add(crease);
  }
  for (std::size_t p = 0; p < found_.planes.planes.size(); ++p) add_plane(p);
  for (const Cylinder& cylinder : found_.cylinders) {
    add(axis_of(cylinder));
    const Eigen::Vector3f middle = (0.5 * (cylinder.begin + cylinder.end)).cast<float>();
    if (task_.tile.holds(middle)) ++(cylinder.is_pole ? figures_.poles : figures_.cylinders);
  }
  figures_.scale = found_.surface.scale;
}

/// Finds what one tile holds; into an empty map what lies in its core.
Status build_tile(PointCloud cloud, const TileTask& task, BuiltMap& out) {
  const BuildConfig& config = task.config;
  BuildFigures& figures = out.figures;
  figures.duplicates += sort_and_deduplicate(cloud);
  const Neighbours tree(cloud.points);
  const auto scale = measure_scale(cloud.points, tree, config.patch, cloud.source);
  if (!scale) return scale.error();
  if (scale->noise_m > kWorstNoise_m && figures.scale.noise_m == 0)
    log_warning(text(cloud.source, ": noise of ", std::lround(1e3 * scale->noise_m),
                     " mm across the surfaces: are these centimetres? Metres are expected"));
  if (!task.progress(0.1)) return kGivenUp;
  const auto start = Clock::now();
  TileContents found;
  found.surface = describe_surface(std::move(cloud.points), tree, *scale, config.patch, task.pool);
  found.brightness = std::move(cloud.brightness);
  if (!task.progress(0.6)) return kGivenUp;
  const auto described = Clock::now();
  found.planes = find_planes(found.surface, config.plane);
  figures.normals_s += seconds(described - start);
  figures.planes_s += seconds(Clock::now() - described);
  if (found.planes.planes.empty())
    return Error{cloud.source, "no plane has enough points", "give a denser cloud"};
  if (!task.progress(0.8) || !find_contours(task, tree, found)) return kGivenUp;
  TileWriter(task, tree, found, out).add_all();
  return {};
}

}  // namespace

Expected<BuiltMap> build_tile(PointCloud cloud, const CloudTile& tile, const BuildConfig& config,
                              ThreadPool& pool, const std::function<bool(double)>& progress) {
  BuiltMap out;
  out.map.anchor = cloud.anchor;
  out.map.source = cloud.source;
  out.figures.points = cloud.points.size();
  out.figures.tiles = 1;
  if (const Status done = build_tile(std::move(cloud), {tile, config, pool, {}, progress}, out); !done)
    return done.error();
  out.figures.planes = out.map.planes.size();
  return out;
}

Status complete_map(ContourMap& map) {
  if (std::all_of(map.points.begin(), map.points.end(),
                  [](const auto& p) { return is_view_dependent(p.kind); }))
    return Error{map.source, text("no contour among ", map.planes.size(), " planes"),
                 "give a larger or denser cloud"};
  map.occluders = triangulated(map.planes, map.polygons);
  return {};
}

Expected<BuiltMap> build_map(PointCloud cloud, const BuildConfig& config, ThreadPool& pool,
                             const std::function<bool(double)>& progress) {
  BuiltMap out;
  ContourMap& map = out.map;
  map.anchor = cloud.anchor;
  map.source = cloud.source;
  out.figures.points = cloud.points.size();
  std::vector<View> views;
  for (const Eigen::Vector3d& eye : cloud.viewpoints) views.emplace_back(eye - cloud.anchor, cloud.points);
  Thinned<Eigen::Vector3f> sample(kTileSample);
  for (const auto& p : cloud.points) sample.add(p);
  const std::vector<CloudTile> tiles =
      cut_into_tiles(sample.kept(), cloud.points.size(), config.tile_points, config.tile_overlap_m);
  out.figures.tiles = tiles.size();
  std::optional<Error> barren;  // what a tile without planes said
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    bool given_up = false;
    const std::function<bool(double)> share_done = [&](double done) {
      given_up = !progress((static_cast<double>(k) + done) / static_cast<double>(tiles.size()));
      return !given_up;
    };
    PointCloud part;
    if (tiles.size() == 1)
      std::swap(part, cloud);
    else
      part = points_seen_by(cloud, tiles[k]);
    if (!share_done(0)) return kGivenUp;
    BuiltMap tile;
    std::swap(tile.figures, out.figures);
    const Status done = build_tile(std::move(part), {tiles[k], config, pool, views, share_done}, tile);
    std::swap(tile.figures, out.figures);
    if (given_up) return kGivenUp;
    if (!done) barren = done.error();
    if (done) append_tile(tile.map, map);
  }
  out.figures.planes = map.planes.size();
  if (map.planes.empty() && barren) return *barren;
  if (const Status done = complete_map(map); !done) return done.error();
  return out;
}

}  // namespace evpose::map_build
