// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/ply.h"

#include <array>
#include <cmath>
#include <cstring>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/maps/ply_file.h"

namespace evpose {
namespace {

using Lists = std::vector<std::vector<double>>;

/// Reads the file through and calls `visit(element, values, lists)` for each row.
template <class Visit>
Status read_rows(PlyFile& file, const Visit& visit) {
  std::vector<double> values;
  Lists lists;
  for (const PlyElement& element : file.elements()) {
    if (element.properties.empty()) continue;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      if (auto status = file.read_row(element, values, lists); !status) return status;
      if (Status status = visit(element, i, values, lists); !status) return status;
    }
  }
  return file.finish();
}

/// Places of x, y, z among an element's scalar values; false if one is missing.
bool find_position(const PlyElement& element, std::array<std::size_t, 3>& places) {
  std::size_t place = 0;
  int found = 0;
  for (const auto& property : element.properties) {
    if (property.count_type) continue;
    for (std::size_t k = 0; k < 3; ++k)
      if (property.name == std::string(1, "xyz"[k])) places[k] = place, ++found;
    ++place;
  }
  return found == 3;
}

Expected<Eigen::Vector3d> position(const std::string& path, std::uint64_t i,
                                   const std::vector<double>& values,
                                   const std::array<std::size_t, 3>& places) {
  const Eigen::Vector3d p(values[places[0]], values[places[1]], values[places[2]]);
  if (!p.allFinite()) return Error{path, text("vertex ", i, " (from 0) is not finite"), "remove it"};
  return p;
}

Error no_position(const std::string& path) {
  return Error{path, "no element 'vertex' with x, y and z", "is it a point cloud or a mesh?"};
}

template <class T>
void put(std::string& out, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.append(bytes, sizeof value);
}

void put(std::string& out, const Eigen::Vector3f& v) { put(out, v.x()), put(out, v.y()), put(out, v.z()); }
void put(std::string& out, const Eigen::Vector3d& v) { put(out, v.x()), put(out, v.y()), put(out, v.z()); }

std::string header(const std::string& comment, std::size_t vertices) {
  return "ply\nformat binary_little_endian 1.0\ncomment " + comment + "\nelement vertex " +
         std::to_string(vertices) + "\n";
}

std::string properties(const std::string& type, std::initializer_list<const char*> names) {
  std::string out;
  for (const char* name : names) out += "property " + type + " " + name + "\n";
  return out;
}

}  // namespace

Status visit_ply_vertices(const std::string& path, const PointBlocks& visit) {
  auto file = PlyFile::open(path);
  if (!file) return file.error();
  PointTable block;
  for (const PlyElement& element : file->elements()) {
    if (element.name != "vertex") continue;
    if (!block.names.empty()) return Error{path, "element 'vertex' stands twice", "write one"};
    for (const auto& property : element.properties)
      if (!property.count_type) block.names.push_back(property.name);
    block.columns.resize(block.names.size());
  }
  if (block.names.empty()) return Error{path, "no element 'vertex' with numbers", "is it a point cloud?"};
  const auto hand_on = [&] {
    Status done = visit(block);
    for (auto& column : block.columns) column.clear();
    return done;
  };
  const auto row = [&](const PlyElement& element, std::uint64_t, const std::vector<double>& values,
                       const Lists&) {
    if (element.name != "vertex") return Status();
    for (std::size_t k = 0; k < values.size(); ++k) block.columns[k].push_back(values[k]);
    return block.rows() < kPointBlock ? Status() : hand_on();
  };
  if (auto status = read_rows(*file, row); !status) return status;
  return hand_on();
}

Expected<PointTable> read_ply_vertices(const std::string& path) {
  return joined_blocks([&](const PointBlocks& visit) { return visit_ply_vertices(path, visit); });
}

Expected<std::vector<Eigen::Vector3d>> read_ply_points(const std::string& path) {
  auto file = PlyFile::open(path);
  if (!file) return file.error();
  std::vector<Eigen::Vector3d> points;
  std::array<std::size_t, 3> places{};
  bool found = false;
  for (const auto& element : file->elements())
    if (element.name == "vertex") found = find_position(element, places);
  if (!found) return no_position(path);
  const auto visit = [&](const PlyElement& element, std::uint64_t i, const std::vector<double>& values,
                         const Lists&) {
    if (element.name != "vertex") return Status();
    const auto p = position(path, i, values, places);
    if (!p) return Status(p.error());
    points.push_back(*p);
    return Status();
  };
  if (auto status = read_rows(*file, visit); !status) return status.error();
  return points;
}

Expected<TriangleMesh> read_ply_mesh(const std::string& path, const Eigen::Vector3d& anchor) {
  auto file = PlyFile::open(path);
  if (!file) return file.error();
  TriangleMesh mesh;
  std::array<std::size_t, 3> places{};
  std::uint64_t vertices = 0;
  bool found = false, has_faces = false;
  for (const auto& element : file->elements()) {
    if (element.name == "vertex") found = find_position(element, places), vertices = element.count;
    has_faces |= element.name == "face";
  }
  if (!found) return no_position(path);
  if (!has_faces) return Error{path, "no element 'face': a cloud, not a mesh", "give a mesh"};
  const auto visit = [&](const PlyElement& element, std::uint64_t i, const std::vector<double>& values,
                         const Lists& lists) {
    if (element.name == "vertex") {
      const auto p = position(path, i, values, places);
      if (!p) return Status(p.error());
      mesh.vertices.push_back((*p - anchor).cast<float>());
    } else if (element.name == "face") {
      std::size_t number = 0;
      for (const auto& property : element.properties) {
        if (!property.count_type) continue;
        const auto& corners = lists[number++];
        if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
        for (const double c : corners)
          if (!(c >= 0 && c < static_cast<double>(vertices)) || c != std::floor(c))
            return Status(
                Error{path, text("face ", i, " (from 0) names vertex ", c, " of ", vertices), "correct it"});
        const auto corner = [&](std::size_t k) { return static_cast<std::uint32_t>(corners[k]); };
        for (std::size_t k = 2; k < corners.size(); ++k)
          mesh.triangles.push_back({corner(0), corner(k - 1), corner(k)});
      }
    }
    return Status();
  };
  if (auto status = read_rows(*file, visit); !status) return status.error();
  return mesh;
}

Status write_ply_contours(const std::string& path, const ContourMap& map) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(header("contours, map frame, metres", map.points.size()) +
              properties("double", {"x", "y", "z"}) +
              properties("float", {"nx", "ny", "nz", "tx", "ty", "tz"}) + properties("uchar", {"kind"}) +
              properties("int", {"contour", "plane_a", "plane_b"}) +
              properties("float", {"length", "sigma"}) + properties("char", {"contrast"}) + "end_header\n");
  std::string row;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const ContourPoint& p = map.points[i];
    row.clear();
    put(row, map.position(i));
    put(row, p.normal);
    put(row, p.tangent);
    put(row, static_cast<std::uint8_t>(p.kind));
    put(row, p.contour);
    put(row, p.plane_a);
    put(row, p.plane_b);
    put(row, p.length);
    put(row, p.sigma);
    put(row, p.contrast);
    file->write(row);
  }
  return file->commit();
}

Status write_obj_map(const std::string& path, const ContourMap& map) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  const auto vertex = [&](const Eigen::Vector3d& p) {
    file->write(text("v ", p.x(), " ", p.y(), " ", p.z(), "\n"));
  };
  file->write("# map frame, metres\n");
  std::size_t next = 1;
  for (std::size_t kind = 0; kind < kContourKinds; ++kind) {
    bool first = true;
    for (std::size_t i = 0; i < map.points.size(); ++i) {
      if (map.points[i].kind != static_cast<ContourKind>(kind)) continue;
      if (first) file->write(text("o contours_", kContourKindNames[kind], "\n"));
      first = false;
      const Eigen::Vector3d half =
          0.5 * static_cast<double>(map.points[i].length) * map.points[i].tangent.cast<double>();
      vertex(map.position(i) - half);
      vertex(map.position(i) + half);
      file->write(text("l ", next, " ", next + 1, "\n"));
      next += 2;
    }
  }
  file->write("o outlines\n");
  for (const MapPolygon& polygon : map.polygons) {
    for (const auto& v : polygon.vertices) vertex(map.anchor + v.cast<double>());
    std::string line = "l";
    for (std::size_t k = 0; k <= polygon.vertices.size() && !polygon.vertices.empty(); ++k)
      line += text(" ", next + k % polygon.vertices.size());
    file->write(line + "\n");
    next += polygon.vertices.size();
  }
  return file->commit();
}

Status write_ply_cloud(const std::string& path, const std::vector<CloudPoint>& points) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(header("cloud, map frame, metres", points.size()) + properties("float", {"x", "y", "z"}) +
              properties("uchar", {"intensity"}) + properties("ushort", {"scan"}) + "end_header\n");
  std::string row;
  for (const CloudPoint& point : points) {
    row.clear();
    put(row, point.position);
    put(row, point.intensity);
    put(row, point.scan);
    file->write(row);
  }
  return file->commit();
}

Status write_ply_measured(const std::string& path, const std::vector<MeasuredPoint>& points) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(header("cloud, map frame, metres; sigma along the line of sight", points.size()) +
              properties("double", {"x", "y", "z"}) + properties("float", {"sigma"}) +
              properties("uint", {"observations"}) + "end_header\n");
  std::string row;
  for (const MeasuredPoint& point : points) {
    row.clear();
    put(row, point.position);
    put(row, point.sigma_m);
    put(row, point.observations);
    file->write(row);
  }
  return file->commit();
}

Status write_ply_points(const std::string& path, const std::vector<Eigen::Vector3d>& points) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(header("metres", points.size()) + properties("float", {"x", "y", "z"}) + "end_header\n");
  std::string row;
  for (const auto& p : points) {
    row.clear();
    put(row, Eigen::Vector3f(p.cast<float>()));
    file->write(row);
  }
  return file->commit();
}

Status write_ply_mesh(const std::string& path, const TriangleMesh& mesh, const Eigen::Vector3d& anchor) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(header("mesh, map frame, metres", mesh.vertices.size()) +
              properties("double", {"x", "y", "z"}) + "element face " +
              std::to_string(mesh.triangles.size()) +
              "\nproperty list uchar int vertex_indices\nend_header\n");
  std::string row;
  for (const auto& v : mesh.vertices) {
    row.clear();
    put(row, Eigen::Vector3d(anchor + v.cast<double>()));
    file->write(row);
  }
  for (const auto& triangle : mesh.triangles) {
    row.clear();
    put(row, std::uint8_t{3});
    for (const std::uint32_t corner : triangle) {
      EVPOSE_CHECK(corner < mesh.vertices.size());
      put(row, static_cast<std::int32_t>(corner));
    }
    file->write(row);
  }
  return file->commit();
}

}  // namespace evpose
