// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "evpose/core/version.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/crc32.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/maps/map_columns.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/map_h5_meta.h"
#include "evpose/io/maps/map_h5_pages.h"

namespace evpose {
namespace {

constexpr std::uint64_t kChunkRows = 65536;  // fewer for a smaller map: readers hold a chunk in memory

/// Columns of /contours and /points as they will stand in the file.
struct Columns {
  std::vector<std::uint64_t> start;
  std::vector<std::uint32_t> count;
  std::vector<std::uint8_t> kind;
  std::vector<std::uint16_t> flags;
  std::vector<std::int32_t> plane_a, plane_b;
  std::vector<float> length, sigma;
  std::vector<std::int8_t> contrast_sign;
  std::vector<float> xyz, tangent, normal_a, normal_b, point_length, point_sigma, seen_from;
  std::vector<std::uint16_t> looks;
};

/// Points of a contour together, contours in the order of their first points.
std::vector<std::size_t> grouped(const ContourMap& map) {
  std::map<std::int32_t, std::size_t> first;
  std::vector<std::size_t> group(map.points.size()), order(map.points.size());
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const std::int32_t contour = map.points[i].contour;
    group[i] = contour < 0 ? i : first.try_emplace(contour, i).first->second;
  }
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return group[a] < group[b]; });
  return order;
}

bool one_contour(const ContourPoint& a, const ContourPoint& b) {
  return a.contour >= 0 && a.contour == b.contour && a.kind == b.kind && a.plane_a == b.plane_a &&
         a.plane_b == b.plane_b && a.contrast == b.contrast;
}

void append(std::vector<float>& out, const Eigen::Vector3f& v) {
  out.insert(out.end(), {v.x(), v.y(), v.z()});
}

Columns columns_of(const ContourMap& map) {
  Columns c;
  const ContourPoint* before = nullptr;
  for (const std::size_t i : grouped(map)) {
    const ContourPoint& p = map.points[i];
    if (before == nullptr || !one_contour(*before, p)) {
      c.start.push_back(c.point_sigma.size());
      c.count.push_back(0);
      c.kind.push_back(static_cast<std::uint8_t>(p.kind));
      c.flags.push_back(0);
      c.plane_a.push_back(p.plane_a);
      c.plane_b.push_back(p.plane_b);
      c.length.push_back(0);
      c.sigma.push_back(p.sigma);
      c.contrast_sign.push_back(p.contrast);
    }
    ++c.count.back();
    c.length.back() += p.length;
    c.sigma.back() = std::max(c.sigma.back(), p.sigma);
    append(c.xyz, p.position);
    append(c.tangent, p.tangent);
    append(c.normal_a, p.normal);
    append(c.normal_b, p.normal_b);
    c.point_length.push_back(p.length);
    c.point_sigma.push_back(p.sigma);
    c.looks.push_back(p.looks);
    append(c.seen_from, p.seen_from);
    before = &p;
  }
  return c;
}

/// The horizontal rectangle around what a page holds.
void set_box(const ContourMap& map, const MapPage& begin, const MapPage& end, MapFilePage& page) {
  Eigen::AlignedBox2f box;
  for (std::uint32_t i = begin.points_end; i < end.points_end; ++i)
    box.extend(map.points[i].position.head<2>());
  for (std::uint32_t i = begin.polygons_end; i < end.polygons_end; ++i)
    for (const auto& v : map.polygons[i].vertices) box.extend(v.head<2>());
  if (box.isEmpty()) return;
  page.low = box.min();
  page.high = box.max();
}

/// The rows of the map's pages; none if the map is not divided, or so changed that its pages are not in
/// order.
std::vector<MapFilePage> pages_of(const ContourMap& map, const Columns& c) {
  std::vector<MapFilePage> out;
  const std::vector<std::size_t> order = grouped(map);
  const bool in_order = std::is_sorted(order.begin(), order.end());
  if (map.pages.size() < 2 || map.polygons.empty() || !in_order ||
      map.pages.back().points_end != map.points.size())
    return out;
  std::uint64_t contours = 0, polygons = 0, vertices = 0;
  MapPage begin;
  for (const MapPage& end : map.pages) {
    MapFilePage page;
    if (!out.empty()) page.first = out.back().end;
    while (contours < c.start.size() && c.start[contours] < end.points_end) ++contours;
    for (; polygons < end.polygons_end; ++polygons) vertices += map.polygons[polygons].vertices.size();
    page.end = {end.points_end, contours, end.planes_end, polygons, vertices};
    set_box(map, begin, end, page);
    out.push_back(page);
    begin = end;
  }
  return out;
}

class Writer {
 public:
  Writer(Hdf5File file, std::vector<MapFilePage> pages) : file_(std::move(file)), pages_(std::move(pages)) {}

  template <class T>
  Status dataset(const std::string& name, NumberType type, const std::vector<T>& values,
                 std::uint64_t width = 1) {
    EVPOSE_CHECK(size_of(type) == sizeof(T) && values.size() % width == 0);
    const std::uint64_t rows = values.size() / width;
    const Hdf5Shape shape = width == 1 ? Hdf5Shape{rows} : Hdf5Shape{rows, width};
    auto made = file_.make_dataset(name, type, shape, std::clamp<std::uint64_t>(rows, 1, kChunkRows));
    if (!made) return made.error();
    if (auto status = file_.append(*made, type, 0, rows, values.data()); !status) return status;
    for (MapFilePage& page : pages_) {
      const MapRows kind = rows_of_dataset(name);
      page.crc += page_checksum(name, values.data() + page.first_of(kind) * width,
                                page.count_of(kind) * width * sizeof(T));
    }
    const std::uint32_t crc = crc32(values.data(), values.size() * sizeof(T));
    return file_.set_attribute(name, "crc32", NumberType::u32, {}, &crc);
  }

  Status contours(const Columns& c);
  Status looks(const Columns& c);
  Status planes(const std::vector<MapPlane>& planes);
  Status polygons(const std::vector<MapPolygon>& polygons);
  Status mesh(const TriangleMesh& mesh);
  Status pages();
  Status places(const PlaceTable& table);
  Status meta(const ContourMap& map, const std::string& created_utc, const MapPlacement& placement);
  Status close();

 private:
  Hdf5File file_;
  std::vector<MapFilePage> pages_;  ///< with the checksums of what has been written
};

/// The first failure of a list of steps.
Status first_failure(std::initializer_list<Status> steps) {
  for (const Status& status : steps)
    if (!status) return status;
  return {};
}

Status Writer::contours(const Columns& c) {
  return first_failure({file_.make_group("/contours"), dataset("/contours/start", NumberType::u64, c.start),
                        dataset("/contours/count", NumberType::u32, c.count),
                        dataset("/contours/kind", NumberType::u8, c.kind),
                        dataset("/contours/flags", NumberType::u16, c.flags),
                        dataset("/contours/plane_a", NumberType::i32, c.plane_a),
                        dataset("/contours/plane_b", NumberType::i32, c.plane_b),
                        dataset("/contours/length", NumberType::f32, c.length),
                        dataset("/contours/sigma", NumberType::f32, c.sigma),
                        dataset("/contours/contrast_sign", NumberType::i8, c.contrast_sign),
                        file_.make_group("/points"), dataset("/points/xyz", NumberType::f32, c.xyz, 3),
                        dataset("/points/tangent", NumberType::f32, c.tangent, 3),
                        dataset("/points/normal_a", NumberType::f32, c.normal_a, 3),
                        dataset("/points/normal_b", NumberType::f32, c.normal_b, 3),
                        dataset("/points/length", NumberType::f32, c.point_length),
                        dataset("/points/sigma", NumberType::f32, c.point_sigma), looks(c)});
}

/// Nothing where flights have told nothing.
Status Writer::looks(const Columns& c) {
  if (std::all_of(c.looks.begin(), c.looks.end(), [](std::uint16_t looks) { return looks == 0; })) return {};
  return first_failure({dataset("/points/looks", NumberType::u16, c.looks),
                        dataset("/points/seen_from", NumberType::f32, c.seen_from, 3)});
}

Status Writer::planes(const std::vector<MapPlane>& planes) {
  if (planes.empty()) return {};
  std::vector<float> normal, rms;
  std::vector<double> d;
  std::vector<std::uint32_t> inliers;
  for (const MapPlane& plane : planes) {
    append(normal, plane.normal);
    d.push_back(plane.d);
    inliers.push_back(plane.inliers);
    rms.push_back(plane.rms);
  }
  return first_failure({file_.make_group("/planes"), dataset("/planes/normal", NumberType::f32, normal, 3),
                        dataset("/planes/d", NumberType::f64, d),
                        dataset("/planes/inliers", NumberType::u32, inliers),
                        dataset("/planes/rms", NumberType::f32, rms)});
}

Status Writer::polygons(const std::vector<MapPolygon>& polygons) {
  if (polygons.empty()) return {};
  std::vector<float> vertices;
  std::vector<std::uint64_t> start;
  std::vector<std::uint32_t> count;
  std::vector<std::int32_t> plane, hole_of;
  for (const MapPolygon& polygon : polygons) {
    start.push_back(vertices.size() / 3);
    count.push_back(static_cast<std::uint32_t>(polygon.vertices.size()));
    plane.push_back(polygon.plane);
    hole_of.push_back(polygon.hole_of);
    for (const auto& v : polygon.vertices) append(vertices, v);
  }
  const std::vector<std::uint8_t> double_sided(polygons.size(), 1);
  return first_failure(
      {file_.make_group("/polygons"), dataset("/polygons/vertices", NumberType::f32, vertices, 3),
       dataset("/polygons/start", NumberType::u64, start), dataset("/polygons/count", NumberType::u32, count),
       dataset("/polygons/plane", NumberType::i32, plane),
       dataset("/polygons/hole_of", NumberType::i32, hole_of),
       dataset("/polygons/double_sided", NumberType::u8, double_sided)});
}

Status Writer::mesh(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return {};
  std::vector<float> vertices;
  for (const auto& v : mesh.vertices) append(vertices, v);
  std::vector<std::uint32_t> triangles;
  for (const auto& t : mesh.triangles) triangles.insert(triangles.end(), t.begin(), t.end());
  return first_failure({file_.make_group("/mesh"), dataset("/mesh/vertices", NumberType::f32, vertices, 3),
                        dataset("/mesh/triangles", NumberType::u32, triangles, 3)});
}

/// After all else.
Status Writer::pages() {
  const std::vector<MapFilePage> pages = std::exchange(pages_, {});
  if (pages.empty()) return {};
  std::vector<std::uint32_t> crc;
  std::vector<float> box;
  for (const MapFilePage& page : pages) {
    crc.push_back(page.crc);
    box.insert(box.end(), {page.low.x(), page.low.y(), page.high.x(), page.high.y()});
  }
  Status done = first_failure({file_.make_group("/pages"), dataset("/pages/crc32", NumberType::u32, crc),
                               dataset("/pages/box", NumberType::f32, box, 4)});
  for (std::size_t k = 0; k < kMapRowNames.size() && done; ++k) {
    std::vector<std::uint64_t> ends;
    for (const MapFilePage& page : pages) ends.push_back(page.end[k]);
    done = dataset(text("/pages/", kMapRowNames[k], "_end"), NumberType::u64, ends);
  }
  return done;
}

/// After the pages: the whole map's.
Status Writer::places(const PlaceTable& table) {
  const std::vector<double> view{table.near_m, table.far_m, table.grazing_sin};
  const Eigen::Vector3d low = table.box.min(), high = table.box.max();
  const std::vector<double> box{low.x(), low.y(), low.z(), high.x(), high.y(), high.z()};
  return first_failure(
      {file_.make_group("/places"), dataset("/places/map", NumberType::u64, std::vector{table.view}),
       dataset("/places/view", NumberType::f64, view), dataset("/places/box", NumberType::f64, box, 3),
       dataset("/places/looked_at", NumberType::u32, table.looked_at),
       dataset("/places/seen", NumberType::u8, table.seen)});
}

Status Writer::meta(const ContourMap& map, const std::string& created_utc, const MapPlacement& placement) {
  const std::uint32_t major = 1, minor = 0;
  std::array<double, 16> T_ned_map = kNedFromEnu;
  if (placement.T_ned_map)
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(T_ned_map.data()) =
        placement.T_ned_map->matrix();
  Eigen::Vector3d low = map.anchor, high = map.anchor;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const Eigen::Vector3d p = map.position(i);
    low = i == 0 ? p : Eigen::Vector3d(low.cwiseMin(p));
    high = i == 0 ? p : Eigen::Vector3d(high.cwiseMax(p));
  }
  const double aabb[6] = {low.x(), low.y(), low.z(), high.x(), high.y(), high.z()};
  const std::string source = map.source.substr(map.source.rfind('/') + 1);
  if (auto status = file_.make_group("/meta"); !status) return status;
  return first_failure(
      {file_.set_attribute("/meta", "format", std::string("evpose-map")),
       file_.set_attribute("/meta", "version_major", NumberType::u32, {}, &major),
       file_.set_attribute("/meta", "version_minor", NumberType::u32, {}, &minor),
       file_.set_attribute("/meta", "required_features", std::vector<std::string>{}),
       file_.set_attribute("/meta", "created_by", text("evpose ", version())),
       created_utc.empty() ? Status() : file_.set_attribute("/meta", "created_utc", created_utc),
       file_.set_attribute("/meta", "units", std::string("m")),
       file_.set_attribute("/meta", "frame", map.frame),
       map.board.empty() ? Status() : file_.set_attribute("/meta", "board", map.board),
       file_.set_attribute("/meta", "anchor", NumberType::f64, {3}, map.anchor.data()),
       map.learnt
           ? file_.set_attribute("/meta", "learnt_about", NumberType::f64, {3}, map.learnt->about.data())
           : Status(),
       map.learnt ? file_.set_attribute("/meta", "learnt_covariance", NumberType::f64, {6, 6},
                                        map.learnt->covariance.data())
                  : Status(),
       file_.set_attribute("/meta", "T_ned_map", NumberType::f64, {4, 4}, T_ned_map.data()),
       placement.origin_llh
           ? file_.set_attribute("/meta", "origin_llh", NumberType::f64, {3}, placement.origin_llh->data())
           : Status(),
       file_.set_attribute("/meta", "aabb", NumberType::f64, {6}, aabb),
       source.empty() ? Status() : file_.set_attribute("/meta", "source_name", source)});
}

Status Writer::close() {
  const auto crc = map_checksum(file_);
  if (!crc) return crc.error();
  if (auto status = file_.set_attribute("/meta", "crc", NumberType::u32, {}, &*crc); !status) return status;
  return file_.close();
}

}  // namespace

ContourMap in_file_order(ContourMap map) {
  const std::vector<std::size_t> order = grouped(map);
  std::vector<ContourPoint> points;
  for (const std::size_t i : order) points.push_back(map.points[i]);
  map.points = std::move(points);
  return map;
}

Status write_map_h5(const std::string& path, const ContourMap& map, const std::string& created_utc,
                    const MapPlacement& placement, const PlaceTable* places) {
  auto temporary = TemporaryFile::create(path);
  if (!temporary) return temporary.error();
  auto file = Hdf5File::create(*temporary);
  if (!file) return file.error();
  const Columns columns = columns_of(map);
  Writer writer(*std::move(file), pages_of(map, columns));
  if (auto status =
          first_failure({writer.contours(columns), writer.planes(map.planes), writer.polygons(map.polygons),
                         map.polygons.empty() ? writer.mesh(map.occluders) : Status(), writer.pages(),
                         places != nullptr ? writer.places(*places) : Status(),
                         writer.meta(map, created_utc, placement), writer.close()});
      !status)
    return status;
  return temporary->commit();
}

}  // namespace evpose
