// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/plane_events.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "evpose/map/depth_buffer.h"
#include "evpose/map/triangulation.h"
#include "evpose/map_learn/contour_neighbours.h"
#include "evpose/map_learn/flight_events.h"

namespace evpose::map_learn {
namespace {

constexpr TimeNs kRedraw = 10 * kNsPerMs;  // of the planes that are seen
constexpr double kCell_px = 0.5;           // of the grid on a plane
constexpr double kSmallestCell_m = 1e-3;
constexpr std::size_t kMostCells = 24'000'000;  // of one plane: 100 MB
constexpr std::size_t kFewEvents = 300;         // of a sampled plane, that are not worth an image
constexpr int kSampledPackets = 16;             // of so many, one tells what is seen of the planes
constexpr double kGrazing = 0.17;               // sine of the angle to the plane below which it is not read

/// What the pixels of a camera see of a map's planes.
class PlaneView {
 public:
  explicit PlaneView(const TrackJob& job)
      : map_(job.map->anchor),
        camera_(*job.setup.camera),
        rays_(pixel_rays(camera_)),
        buffer_(largest_tangents(rays_), 2 / camera_.focal_px()) {
    label_triangles(*job.map);
  }

  void look(const Pose& T_map_cam) {
    T_map_cam_ = T_map_cam;
    buffer_.render(labelled_, T_map_cam, 0.1);
  }
  void move(const Pose& T_map_cam) { T_map_cam_ = T_map_cam, R_ = T_map_cam.rotation(); }

  struct Hit {
    int plane;
    Eigen::Vector3d point;  ///< map frame
    double pixel_m;
  };
  std::optional<Hit> hit(int x, int y) const {
    const Eigen::Vector3d& ray =
        rays_[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.size().width) +
              static_cast<std::size_t>(x)];
    if (ray.z() == 0) return std::nullopt;
    const auto triangle = buffer_.triangle_at(ray.head<2>().cast<float>());
    if (!triangle) return std::nullopt;
    const int plane = plane_of_[*triangle];
    const auto& [normal, d] = planes_[static_cast<std::size_t>(plane)];
    const Eigen::Vector3d way = R_ * ray;
    const double slope = normal.dot(way);
    if (std::abs(slope) < kGrazing * way.norm()) return std::nullopt;
    const double depth = -(normal.dot(T_map_cam_.p) + d) / slope;
    if (!(depth > 0)) return std::nullopt;
    return Hit{plane, T_map_cam_.p + depth * way, depth / camera_.focal_px()};
  }
  const Eigen::Vector3d& normal(int plane) const { return planes_[static_cast<std::size_t>(plane)].first; }

 private:
  /// The planes' polygons as triangles that know their planes.
  void label_triangles(const ContourMap& map) {
    labelled_.anchor = map.anchor;
    for (const MapPlane& plane : map.planes) {
      const Eigen::Vector3d n = plane.normal.cast<double>().normalized();
      planes_.emplace_back(n, plane.d - n.dot(map.anchor));
    }
    for (std::size_t p = 0; p < map.planes.size(); ++p) {
      std::vector<MapPolygon> own;
      std::vector<std::int32_t> number(map.polygons.size(), -1);
      for (std::size_t g = 0; g < map.polygons.size(); ++g)
        if (map.polygons[g].plane == static_cast<std::int32_t>(p)) {
          number[g] = static_cast<std::int32_t>(own.size());
          own.push_back(map.polygons[g]);
        }
      for (MapPolygon& polygon : own)
        if (polygon.hole_of >= 0) polygon.hole_of = number[static_cast<std::size_t>(polygon.hole_of)];
      const TriangleMesh mesh = triangulated(map.planes, own);
      const auto first = static_cast<std::uint32_t>(labelled_.occluders.vertices.size());
      labelled_.occluders.vertices.insert(labelled_.occluders.vertices.end(), mesh.vertices.begin(),
                                          mesh.vertices.end());
      for (const auto& t : mesh.triangles) {
        labelled_.occluders.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
        plane_of_.push_back(static_cast<int>(p));
      }
    }
  }

  Eigen::Vector3d map_;
  const Camera& camera_;
  std::vector<Eigen::Vector3d> rays_;  ///< pixel_rays()
  ContourMap labelled_;                ///< its occluders are the planes' polygons
  std::vector<int> plane_of_;
  std::vector<std::pair<Eigen::Vector3d, double>> planes_;  ///< normal . x + d = 0, map frame
  DepthBuffer buffer_;
  Pose T_map_cam_;
  Eigen::Matrix3d R_ = Eigen::Matrix3d::Identity();
};

/// Calls take(hit) for the events of the recording, or for those of some packets.
Status for_each_hit(const TrackJob& job, const Trajectory& trajectory, int every,
                    const std::function<bool(double)>& progress, PlaneView& view,
                    const std::function<void(const PlaneView::Hit&)>& take) {
  TimeNs drawn = std::numeric_limits<TimeNs>::min();
  return for_each_packet(job, trajectory, every, progress,
                         [&](TimeNs t, const Pose& T_map_cam, std::span<const Event> events) {
                           if (drawn == std::numeric_limits<TimeNs>::min() || t - drawn >= kRedraw)
                             view.look(T_map_cam), drawn = t;
                           view.move(T_map_cam);
                           for (const Event& e : events)
                             if (const auto hit = view.hit(e.x, e.y)) take(*hit);
                         });
}

/// Where a plane is seen, and how finely.
struct Extent {
  Eigen::Vector3d right, up;
  Eigen::AlignedBox2d box;
  double inverse_pixel = 0;  ///< sum of 1 / pixel size
  std::size_t events = 0;
};

std::optional<PlaneEvents> make_plane(int plane, const Extent& extent, const Eigen::Vector3d& normal,
                                      double d) {
  if (extent.events < kFewEvents) return std::nullopt;
  PlaneEvents out;
  out.plane = plane;
  out.right = extent.right, out.up = extent.up;
  out.pixel_m = static_cast<double>(extent.events) / extent.inverse_pixel;
  const Eigen::Vector2d size = extent.box.sizes();
  out.cell_m = std::max({kSmallestCell_m, kCell_px * out.pixel_m,
                         std::sqrt(size.x() * size.y() / static_cast<double>(kMostCells))});
  const Eigen::Vector2d& low = extent.box.min();
  out.origin = -d * normal + low.x() * out.right + low.y() * out.up;
  out.image.width = static_cast<int>(size.x() / out.cell_m) + 1;
  out.image.height = static_cast<int>(size.y() / out.cell_m) + 1;
  out.image.counts.assign(
      static_cast<std::size_t>(out.image.width) * static_cast<std::size_t>(out.image.height), 0);
  return out;
}

constexpr double kPointSpacing_m = 0.01;
constexpr double kStartSigma_m = 1.5e-3;  // of a marking whose place is that of the trajectory's events
constexpr double kShortest_m = 0.05, kLongest_m = 0.12;
constexpr double kShortest_px = 6;
constexpr double kApart_px = 3;        // markings side by side
constexpr double kFromContour_px = 3;  // from a contour of the map that runs beside it

/// The points of one line; none if a contour of the map runs beside it.
std::vector<ContourPoint> points_of(const PlaneEvents& plane, const RidgeLine& line, const ContourMap& map,
                                    const ContourNeighbours& neighbours) {
  const auto place = [&](const Eigen::Vector2d& cell) -> Eigen::Vector3d {
    return plane.origin + plane.cell_m * ((cell.x() + 0.5) * plane.right + (cell.y() + 0.5) * plane.up) -
           map.anchor;
  };
  const Eigen::Vector3d a = place(line.a), b = place(line.b);
  const double length = (b - a).norm();
  const int count = std::max(2, static_cast<int>(length / kPointSpacing_m));
  ContourPoint p;
  p.tangent = ((b - a) / length).cast<float>();
  p.normal = map.planes[static_cast<std::size_t>(plane.plane)].normal.cross(p.tangent).normalized();
  p.length = static_cast<float>(length / count);
  p.sigma = static_cast<float>(kStartSigma_m);
  p.plane_a = plane.plane;
  p.kind = ContourKind::marking;
  std::vector<ContourPoint> out;
  int beside = 0;
  for (int i = 0; i < count; ++i) {
    p.position = (a + (i + 0.5) / count * (b - a)).cast<float>();
    beside += neighbours.beside(p.position, p.tangent,
                                static_cast<float>(std::max(kFromContour_px * plane.pixel_m, 8e-3)));
    out.push_back(p);
  }
  if (2 * beside > count) out.clear();
  return out;
}

}  // namespace

Expected<std::vector<PlaneEvents>> events_on_planes(const TrackJob& job, const Trajectory& trajectory,
                                                    const std::function<bool(double)>& progress) {
  const auto& map = *job.map;
  if (map.polygons.empty()) return std::vector<PlaneEvents>{};
  PlaneView view(job);
  std::vector<Extent> extents(map.planes.size());
  for (std::size_t p = 0; p < extents.size(); ++p) {
    extents[p].right = view.normal(static_cast<int>(p)).unitOrthogonal();
    extents[p].up = view.normal(static_cast<int>(p)).cross(extents[p].right);
  }
  const auto flat = [&](const PlaneView::Hit& hit) -> Eigen::Vector2d {
    const Extent& e = extents[static_cast<std::size_t>(hit.plane)];
    return {e.right.dot(hit.point), e.up.dot(hit.point)};
  };
  auto ok = for_each_hit(
      job, trajectory, kSampledPackets, [&](double s) { return progress(0.1 * s); }, view,
      [&](const PlaneView::Hit& hit) {
        Extent& e = extents[static_cast<std::size_t>(hit.plane)];
        e.box.extend(flat(hit));
        e.inverse_pixel += 1 / hit.pixel_m;
        ++e.events;
      });
  if (!ok) return ok.error();
  std::vector<PlaneEvents> out;
  std::vector<int> place(extents.size(), -1);
  for (std::size_t p = 0; p < extents.size(); ++p) {
    const Eigen::Vector3d& n = view.normal(static_cast<int>(p));
    auto made = make_plane(static_cast<int>(p), extents[p], n, map.planes[p].d - n.dot(map.anchor));
    if (!made) continue;
    place[p] = static_cast<int>(out.size());
    out.push_back(std::move(*made));
  }
  ok = for_each_hit(
      job, trajectory, 1, [&](double s) { return progress(0.1 + 0.9 * s); }, view,
      [&](const PlaneView::Hit& hit) {
        const int at = place[static_cast<std::size_t>(hit.plane)];
        if (at < 0) return;
        PlaneEvents& plane = out[static_cast<std::size_t>(at)];
        const Eigen::Vector2d cell =
            (flat(hit) - extents[static_cast<std::size_t>(hit.plane)].box.min()) / plane.cell_m;
        const int x = static_cast<int>(std::floor(cell.x())), y = static_cast<int>(std::floor(cell.y()));
        if (x < 0 || y < 0 || x >= plane.image.width || y >= plane.image.height) return;
        plane.image.counts[static_cast<std::size_t>(y) * static_cast<std::size_t>(plane.image.width) +
                           static_cast<std::size_t>(x)] += 1;
      });
  if (!ok) return ok.error();
  return out;
}

std::vector<ContourPoint> find_markings(const std::vector<PlaneEvents>& planes, const ContourMap& map,
                                        std::int32_t first_contour) {
  const ContourNeighbours neighbours(map);
  std::vector<ContourPoint> out;
  for (const PlaneEvents& plane : planes) {
    LineDetectorConfig config;
    config.least_length = std::max(kShortest_m, kShortest_px * plane.pixel_m) / plane.cell_m;
    config.most_length = std::max(kLongest_m / plane.cell_m, 1.5 * config.least_length);
    for (const RidgeLine& line :
         detect_lines(plane.image, config, kApart_px * plane.pixel_m / plane.cell_m)) {
      auto points = points_of(plane, line, map, neighbours);
      if (points.empty()) continue;
      for (ContourPoint& p : points) p.contour = first_contour;
      ++first_contour;
      out.insert(out.end(), points.begin(), points.end());
    }
  }
  return out;
}

}  // namespace evpose::map_learn
