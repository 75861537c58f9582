// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/map_h5.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/io/files/input_file.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/maps/map_columns.h"
#include "evpose/io/maps/map_h5_meta.h"
#include "evpose/io/maps/map_h5_pages.h"
#include "evpose/map/triangulation.h"

namespace evpose {
namespace {

constexpr std::array<char, 4> kHdf5Magic = {'\x89', 'H', 'D', 'F'};

Eigen::Vector3f row3(const std::vector<float>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

/// The one text of an attribute, empty if it is none.
std::string meta_text(const Hdf5File& file, const std::string& name) {
  const auto values = file.attribute_strings("/meta", name);
  return values && values->size() == 1 ? values->front() : "";
}

}  // namespace

Status read_map_meta(const Hdf5File& file, ContourMap& map) {
  const std::string where = file.path() + ": /meta";
  if (meta_text(file, "format") != "evpose-map")
    return Error{file.path(), "is HDF5, but not a map file (no /meta with format evpose-map)", "give a map"};
  const auto major = file.attribute_numbers("/meta", "version_major");
  if (!major || major->size() != 1 || major->front() != 1)
    return Error{
        where,
        text("version_major is ", major && !major->empty() ? major->front() : 0, ", this reader knows 1"),
        "use a newer program, or build the map again"};
  const auto features = file.attribute_strings("/meta", "required_features");
  if (features && !features->empty())
    return Error{where, "the map needs '" + features->front() + "', which this reader does not know",
                 "use a newer program"};
  if (meta_text(file, "units") != "m")
    return Error{where, "units are '" + meta_text(file, "units") + "', not m", "use metres"};
  const auto anchor = file.attribute_numbers("/meta", "anchor");
  if (!anchor || anchor->size() != 3) return Error{where, "no anchor of three numbers", kMapDamaged};
  map.anchor = {(*anchor)[0], (*anchor)[1], (*anchor)[2]};
  if (!(map.anchor.cwiseAbs().maxCoeff() <= kFarthestInMap))
    return Error{where, "the anchor is not finite or out of range", kMapDamaged};
  const auto about = file.attribute_numbers("/meta", "learnt_about");
  const auto covariance = file.attribute_numbers("/meta", "learnt_covariance");
  if (about && covariance) {
    if (about->size() != 3 || covariance->size() != 36)
      return Error{where, "learnt_about and learnt_covariance are not 3 and 6 x 6 numbers", kMapDamaged};
    LearntFrame& learnt = map.learnt.emplace();
    learnt.about = Eigen::Map<const Eigen::Vector3d>(about->data());
    learnt.covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(covariance->data());
    if (!learnt.about.allFinite() || learnt.covariance.llt().info() != Eigen::Success)
      return Error{where, "learnt_covariance is not positive definite, or learnt_about not finite",
                   kMapDamaged};
  }
  map.frame = meta_text(file, "frame");
  map.board = meta_text(file, "board");
  return {};
}

namespace {

Status read_points(const Hdf5File& file, MapColumns& columns, ContourMap& map) {
  const auto xyz_dataset = file.dataset("/points/xyz", 2);
  if (!xyz_dataset) return xyz_dataset.error();
  std::vector<float> xyz;
  if (xyz_dataset->type() == NumberType::f64) {
    const bool absolute = xyz_dataset->attribute_u32("absolute").value_or(0) == 1;
    const auto exact = columns.column<double>("/points/xyz", 3, -1);
    for (std::size_t k = 0; k < exact.size(); ++k)
      xyz.push_back(
          static_cast<float>(exact[k] - (absolute ? map.anchor[static_cast<Eigen::Index>(k % 3)] : 0)));
  } else {
    xyz = columns.column<float>("/points/xyz", 3, -1);
  }
  const auto rows = static_cast<std::int64_t>(xyz.size() / 3);
  const auto tangent = columns.column<float>("/points/tangent", 3, rows);
  const auto normal = columns.column<float>("/points/normal_a", 3, rows);
  const bool has_b = file.has("/points/normal_b");
  const auto normal_b = has_b ? columns.column<float>("/points/normal_b", 3, rows) : std::vector<float>();
  const bool own_sigma = file.has("/points/sigma");
  const auto sigma = own_sigma ? columns.column<float>("/points/sigma", 1, rows) : std::vector<float>();
  const bool own_length = file.has("/points/length");
  const auto length = own_length ? columns.column<float>("/points/length", 1, rows) : std::vector<float>();
  const bool learnt = file.has("/points/looks") && file.has("/points/seen_from");
  const auto looks =
      learnt ? columns.column<std::uint16_t>("/points/looks", 1, rows) : std::vector<std::uint16_t>();
  const auto seen_from = learnt ? columns.column<float>("/points/seen_from", 3, rows) : std::vector<float>();
  if (!columns.status()) return columns.status();
  map.points.resize(static_cast<std::size_t>(rows));
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    ContourPoint& p = map.points[i];
    p.position = row3(xyz, i);
    p.tangent = row3(tangent, i);
    p.normal = row3(normal, i);
    if (has_b) p.normal_b = row3(normal_b, i);
    if (own_sigma) p.sigma = std::max(sigma[i], 0.0F);
    if (own_length) p.length = std::max(length[i], 0.0F);
    if (learnt) p.looks = looks[i], p.seen_from = row3(seen_from, i);
  }
  return {};
}

/// Shares a contour's length among its points by their distances; evenly when they have none.
void share_length(ContourPoint* points, std::size_t count, float length, bool closed) {
  std::vector<float> share(count, 0);
  float sum = 0;
  const auto add = [&](std::size_t a, std::size_t b) {
    const float d = (points[a].position - points[b].position).norm();
    share[a] += d / 2;
    share[b] += d / 2;
    sum += d;
  };
  for (std::size_t i = 1; i < count; ++i) add(i - 1, i);
  if (closed && count > 2) add(count - 1, 0);
  for (std::size_t i = 0; i < count; ++i)
    points[i].length =
        sum > 0 ? share[i] * (length > 0 ? length / sum : 1) : length / static_cast<float>(count);
}

Status read_contours(const Hdf5File& file, MapColumns& columns, ContourMap& map) {
  const auto start = columns.column<std::uint64_t>("/contours/start", 1, -1);
  const auto contours = static_cast<std::int64_t>(start.size());
  const auto count = columns.column<std::uint32_t>("/contours/count", 1, contours);
  const auto kind = columns.column<std::uint8_t>("/contours/kind", 1, contours);
  const auto plane_a = columns.column<std::int32_t>("/contours/plane_a", 1, contours);
  const auto plane_b = columns.column<std::int32_t>("/contours/plane_b", 1, contours);
  const auto length = columns.column<float>("/contours/length", 1, contours);
  const auto sigma = columns.column<float>("/contours/sigma", 1, contours);
  const auto contrast = columns.column<std::int8_t>("/contours/contrast_sign", 1, contours);
  const auto flags = columns.column<std::uint16_t>("/contours/flags", 1, contours);
  if (!columns.status()) return columns.status();
  const std::uint64_t first_point = columns.first_of(MapRows::points);
  const auto first_plane = static_cast<std::int32_t>(columns.first_of(MapRows::planes));
  const auto first_contour = static_cast<std::int32_t>(columns.first_of(MapRows::contours));
  std::int64_t planes = -1;  // unknown
  if (columns.page() != nullptr)
    planes = static_cast<std::int64_t>(columns.page()->count_of(MapRows::planes));
  else if (file.has("/planes/d"))
    planes = static_cast<std::int64_t>(columns.column<double>("/planes/d", 1, -1).size());
  if (!columns.status()) return columns.status();
  const bool own_sigma = file.has("/points/sigma"), own_length = file.has("/points/length");
  std::vector<bool> taken(map.points.size(), false);
  for (std::size_t c = 0; c < start.size(); ++c) {
    const std::string where = file.path() + ": /contours";
    const std::uint64_t from = start[c] - first_point;  // huge if the page begins later
    if (from > map.points.size() || count[c] > map.points.size() - from)
      return Error{where, text("row ", c, " reaches beyond the ", map.points.size(), " points"), kMapDamaged};
    for (const std::int32_t plane : {plane_a[c], plane_b[c]})
      if (plane < -1 || (planes >= 0 && plane >= first_plane + planes) || (plane >= 0 && plane < first_plane))
        return Error{where, text("row ", c, " names plane ", plane, " of ", planes), kMapDamaged};
    ContourPoint* points = map.points.data() + from;
    for (std::size_t i = 0; i < count[c]; ++i) {
      if (taken[from + i]) return Error{where, text("row ", c, " shares points with another"), kMapDamaged};
      taken[from + i] = true;
      points[i].contour = count[c] > 1 ? first_contour + static_cast<std::int32_t>(c) : -1;
      points[i].kind = contour_kind(kind[c]);
      points[i].plane_a = plane_a[c];
      points[i].plane_b = plane_b[c];
      points[i].contrast = static_cast<std::int8_t>(std::clamp<int>(contrast[c], -1, 1));
      if (!own_sigma) points[i].sigma = std::max(sigma[c], 0.0F);
    }
    if (count[c] > 0 && !own_length)
      share_length(points, count[c], std::max(length[c], 0.0F), (flags[c] & 1) != 0);
  }
  return {};
}

Status read_mesh(const Hdf5File& file, MapColumns& columns, TriangleMesh& mesh) {
  if (!file.has("/mesh/vertices")) return {};
  const auto vertices = columns.column<float>("/mesh/vertices", 3, -1);
  const auto triangles = columns.column<std::uint32_t>("/mesh/triangles", 3, -1);
  if (!columns.status()) return columns.status();
  for (std::size_t i = 0; i < vertices.size() / 3; ++i) mesh.vertices.push_back(row3(vertices, i));
  for (std::size_t i = 0; i < triangles.size() / 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      if (triangles[3 * i + k] >= mesh.vertices.size())
        return Error{file.path() + ": /mesh/triangles",
                     text("row ", i, " names vertex ", triangles[3 * i + k], " of ", mesh.vertices.size()),
                     kMapDamaged};
    mesh.triangles.push_back({triangles[3 * i], triangles[3 * i + 1], triangles[3 * i + 2]});
  }
  return {};
}

Status read_planes(const Hdf5File& file, MapColumns& columns, ContourMap& map) {
  if (!file.has("/planes/d")) return {};
  const auto d = columns.column<double>("/planes/d", 1, -1);
  const auto rows = static_cast<std::int64_t>(d.size());
  const auto normal = columns.column<float>("/planes/normal", 3, rows);
  const auto inliers = columns.column<std::uint32_t>("/planes/inliers", 1, rows);
  const auto rms = columns.column<float>("/planes/rms", 1, rows);
  if (!columns.status()) return columns.status();
  for (std::size_t i = 0; i < d.size(); ++i)
    map.planes.push_back({row3(normal, i), d[i], inliers[i], rms[i]});
  return {};
}

Status read_polygons(const Hdf5File& file, MapColumns& columns, ContourMap& map) {
  if (!file.has("/polygons/start")) return {};
  const auto vertices = columns.column<float>("/polygons/vertices", 3, -1);
  const auto start = columns.column<std::uint64_t>("/polygons/start", 1, -1);
  const auto rows = static_cast<std::int64_t>(start.size());
  const auto count = columns.column<std::uint32_t>("/polygons/count", 1, rows);
  const auto plane = columns.column<std::int32_t>("/polygons/plane", 1, rows);
  const auto hole_of = columns.column<std::int32_t>("/polygons/hole_of", 1, rows);
  if (file.has("/polygons/double_sided"))  // all are
    static_cast<void>(columns.column<std::uint8_t>("/polygons/double_sided", 1, rows));
  if (!columns.status()) return columns.status();
  const std::string where = file.path() + ": /polygons";
  const auto planes = static_cast<std::int64_t>(map.planes.size());
  const std::uint64_t first_vertex = columns.first_of(MapRows::vertices);
  const auto first_plane = static_cast<std::int32_t>(columns.first_of(MapRows::planes));
  const auto first_polygon = static_cast<std::int32_t>(columns.first_of(MapRows::polygons));
  const auto within = [](std::int32_t number, std::int32_t first, std::int64_t all) {
    return number == -1 || (number >= first && number < first + all);
  };
  const auto moved = [](std::int32_t number, std::int32_t first) {
    return number < 0 ? number : number - first;
  };
  std::uint64_t untaken = vertices.size() / 3;
  for (std::size_t g = 0; g < start.size(); ++g) {
    const std::uint64_t from = start[g] - first_vertex;
    if (from > vertices.size() / 3 || count[g] > vertices.size() / 3 - from)
      return Error{where, text("row ", g, " reaches beyond the ", vertices.size() / 3, " vertices"),
                   kMapDamaged};
    if (count[g] > untaken)
      return Error{where, text("row ", g, " shares vertices with another"), kMapDamaged};
    untaken -= count[g];
    if (!within(plane[g], first_plane, planes))
      return Error{where, text("row ", g, " names plane ", plane[g], " of ", planes), kMapDamaged};
    if (!within(hole_of[g], first_polygon, rows))
      return Error{where, text("row ", g, " is a hole of row ", hole_of[g], " of ", rows), kMapDamaged};
    MapPolygon polygon;
    polygon.plane = moved(plane[g], first_plane);
    polygon.hole_of = moved(hole_of[g], first_polygon);
    for (std::size_t i = 0; i < count[g]; ++i) polygon.vertices.push_back(row3(vertices, from + i));
    map.polygons.push_back(std::move(polygon));
  }
  return {};
}

Status check_whole(const Hdf5File& file) {
  const auto stored = file.attribute_numbers("/meta", "crc");
  if (!stored || stored->size() != 1)
    return Error{file.path() + ": /meta", "has no checksum", "build the map again"};
  const auto crc = map_checksum(file);
  if (!crc) return crc.error();
  if (!(stored->front() >= 0 && stored->front() <= UINT32_MAX) ||
      !crc32_agrees(static_cast<std::uint32_t>(stored->front()), *crc))
    return Error{file.path() + ": /meta", "does not match its checksum", kMapDamaged};
  return {};
}

}  // namespace

Expected<ContourMap> read_map_page(const Hdf5File& file, const MapFilePage& page) {
  ContourMap map;
  map.source = file.path();
  if (auto status = read_map_meta(file, map); !status) return status.error();
  MapColumns columns(file, &page);
  if (auto status = read_points(file, columns, map); !status) return status.error();
  if (auto status = read_contours(file, columns, map); !status) return status.error();
  if (auto status = read_planes(file, columns, map); !status) return status.error();
  if (auto status = read_polygons(file, columns, map); !status) return status.error();
  if (auto status = columns.finish(); !status) return status.error();
  map.occluders = triangulated(map.planes, map.polygons);
  return map;
}

Expected<ContourMap> read_map_h5(const std::string& path) {
  const auto file = Hdf5File::open(path);
  if (!file) return file.error();
  ContourMap map;
  map.source = path;
  if (auto status = read_map_meta(*file, map); !status) return status.error();
  MapColumns columns(*file);
  if (auto status = read_points(*file, columns, map); !status) return status.error();
  if (auto status = read_contours(*file, columns, map); !status) return status.error();
  if (auto status = read_mesh(*file, columns, map.occluders); !status) return status.error();
  if (auto status = read_planes(*file, columns, map); !status) return status.error();
  if (auto status = read_polygons(*file, columns, map); !status) return status.error();
  if (auto status = check_whole(*file); !status) return status.error();
  const auto pages = read_map_pages(*file);
  if (!pages) return pages.error();
  for (const MapFilePage& page : *pages)
    map.pages.push_back({static_cast<std::uint32_t>(page.end_of(MapRows::points)),
                         static_cast<std::uint32_t>(page.end_of(MapRows::planes)),
                         static_cast<std::uint32_t>(page.end_of(MapRows::polygons))});
  if (map.occluders.triangles.empty()) map.occluders = triangulated(map.planes, map.polygons);
  return map;
}

bool is_hdf5_file(const std::string& path) {
  const auto opened = open_to_read(path);
  std::array<char, 4> head{};
  return opened && std::fread(head.data(), 1, head.size(), opened->stream.get()) == head.size() &&
         head == kHdf5Magic;
}

Expected<std::string> read_map_board(const std::string& path) {
  if (!is_hdf5_file(path)) return std::string();
  const auto file = Hdf5File::open(path);
  return file ? Expected(meta_text(*file, "board")) : file.error();
}

Expected<MapPlacement> read_map_placement(const std::string& path) {
  MapPlacement out;
  if (open_to_read(path).ok() && !is_hdf5_file(path)) return out;
  const auto file = Hdf5File::open(path);
  if (!file) return file.error();
  const auto T = file->attribute_numbers("/meta", "T_ned_map");
  if (T && !(T->size() == kNedFromEnu.size() && std::equal(T->begin(), T->end(), kNedFromEnu.begin()))) {
    using Matrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
    const Eigen::Matrix4d M =
        T->size() == 16 ? Matrix(Eigen::Map<const Matrix>(T->data())) : Matrix(Matrix::Zero());
    const Eigen::Matrix3d R = M.topLeftCorner<3, 3>();
    if (!M.allFinite() || !((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6) ||
        R.determinant() < 0)
      return Error{path + ": /meta", "T_ned_map is no rigid transform", kMapDamaged};
    out.T_ned_map = Pose::from_matrix(M);
  }
  if (const auto llh = file->attribute_numbers("/meta", "origin_llh")) {
    if (llh->size() != 3 || !(std::abs((*llh)[0]) <= 90) || !(std::abs((*llh)[1]) <= 180) ||
        !(std::abs((*llh)[2]) <= kFarthestInMap))
      return Error{path + ": /meta", "origin_llh is no place on earth", kMapDamaged};
    out.origin_llh = Eigen::Vector3d((*llh)[0], (*llh)[1], (*llh)[2]);
  }
  return out;
}

}  // namespace evpose
