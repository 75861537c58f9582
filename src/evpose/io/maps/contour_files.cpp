// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/contour_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "evpose/core/log.h"
#include "evpose/io/maps/contour_completion.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/pcd.h"
#include "evpose/io/maps/ply.h"
#include "evpose/io/maps/surface_shape.h"

namespace evpose {
namespace {

constexpr double kFarthest = 1e7;  // m from the origin of the map

Error cloud_error(const std::string& path) {
  return Error{path, "is a cloud of surface points, not a map of contours",
               "run `evpose map build " + path + " -o map.h5` and give map.h5"};
}

/// Three columns that together are a vector; all pointers set, or none.
struct VectorColumns {
  std::array<const std::vector<double>*, 3> c{};

  explicit operator bool() const { return c[0] != nullptr; }
  Eigen::Vector3d at(std::size_t i) const { return {(*c[0])[i], (*c[1])[i], (*c[2])[i]}; }
};

VectorColumns find_vector(const PointTable& table, std::array<const char*, 3> names) {
  VectorColumns v;
  for (std::size_t k = 0; k < 3; ++k) {
    v.c[k] = table.find(names[k]);
    if (v.c[k] == nullptr) return {};
  }
  return v;
}

Error point_error(const std::string& path, std::size_t i, const std::string& what, const std::string& fix) {
  return Error{path, text("point ", i, " (from 0): ", what), fix};
}

/// Of the columns that are used; others may hold what they like.
Status check_finite(const PointTable& table, const std::string& path) {
  for (const char* name :
       {"x",  "y",  "z",  "nx", "ny",   "nz",      "normal_x", "normal_y", "normal_z", "tx",    "ty",
        "tz", "xg", "yg", "zg", "kind", "contour", "plane_a",  "plane_b",  "length",   "sigma", "contrast"}) {
    const auto* column = table.find(name);
    if (column == nullptr) continue;
    for (std::size_t i = 0; i < column->size(); ++i)
      if (!std::isfinite((*column)[i]))
        return point_error(path, i, text(name, " is not finite (nan or inf)"), "remove the point");
  }
  return {};
}

/// Second points told in a frame that is turned by half about x, as in clouds released with EVIT; seen by
/// their lying beside x y z once they are turned back.
bool half_turned(const VectorColumns& position, const VectorColumns& gradient, std::size_t rows) {
  constexpr double kBeside_m = 0.5;
  std::size_t near = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    const Eigen::Vector3d g = gradient.at(i);
    near += (position.at(i) - Eigen::Vector3d(g.x(), -g.y(), -g.z())).norm() < kBeside_m ? 1 : 0;
  }
  return static_cast<double>(near) > 0.95 * static_cast<double>(rows);
}

/// A direction perpendicular to the contour from the columns xg yg zg, one for each point (zero where
/// unknown).
Expected<std::vector<Eigen::Vector3d>> from_gradient(const VectorColumns& position,
                                                     const VectorColumns& gradient, std::size_t rows,
                                                     GradientColumns kind, const std::string& path) {
  std::vector<double> distance(rows);
  std::size_t near = 0, unit = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    distance[i] = (position.at(i) - gradient.at(i)).norm();
    near += distance[i] < 0.5 ? 1 : 0;
    unit += std::abs(gradient.at(i).norm() - 1) < 0.01 ? 1 : 0;
  }
  const bool turned =
      kind == GradientColumns::automatic && half_turned(position, gradient, rows) && 2 * near < rows;
  if (turned) {
    log_warning(path + ": xg yg zg are points in a frame turned by half about x; turned back");
    kind = GradientColumns::point;
  }
  if (kind == GradientColumns::automatic) {
    const double share_near = static_cast<double>(near) / static_cast<double>(rows);
    const double share_unit = static_cast<double>(unit) / static_cast<double>(rows);
    if (share_unit > 0.95 && share_near < 0.95) {
      kind = GradientColumns::direction;
    } else if (share_near > 0.95) {
      kind = GradientColumns::point;
    } else {
      std::nth_element(distance.begin(), distance.begin() + static_cast<std::ptrdiff_t>(rows / 2),
                       distance.end());
      return Error{path,
                   text("xg yg zg are neither directions nor points beside x y z (median distance ",
                        distance[rows / 2], " m): another frame?"),
                   "write both in one frame, or leave xg yg zg out"};
    }
    log_detail(path + ": xg yg zg are read as " +
               (kind == GradientColumns::point ? "second points" : "directions"));
  }
  std::vector<Eigen::Vector3d> normals(rows, Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < rows; ++i) {
    Eigen::Vector3d second = gradient.at(i);
    if (turned) second.tail<2>() *= -1;
    const Eigen::Vector3d g =
        kind == GradientColumns::point ? Eigen::Vector3d(position.at(i) - second) : second;
    const double norm = g.norm();
    const bool usable = norm > 1e-9 && (kind == GradientColumns::direction || norm < 0.5);
    if (usable) normals[i] = g / norm;
  }
  return normals;
}

template <class T>
Expected<T> whole(const PointTable& table, const char* name, std::size_t i, T absent,
                  const std::string& path) {
  const auto* column = table.find(name);
  if (column == nullptr) return absent;
  const double v = (*column)[i];
  if (v != std::floor(v) || v < std::numeric_limits<T>::min() || v > std::numeric_limits<T>::max())
    return point_error(path, i, text(name, " = ", v, " is out of range"), "correct it");
  return static_cast<T>(v);
}

Expected<float> not_negative(const PointTable& table, const char* name, std::size_t i,
                             const std::string& path) {
  const auto* column = table.find(name);
  if (column == nullptr) return 0.0F;
  const double v = (*column)[i];
  if (!(v >= 0 && v < 1e6))
    return point_error(path, i, text(name, " = ", v, " m is out of range"), "correct it");
  return static_cast<float>(v);
}

Status fill_entries(const PointTable& table, std::size_t i, const std::string& path, ContourPoint& p) {
  const auto kind = whole<std::uint8_t>(table, "kind", i, 0, path);
  const auto contour = whole<std::int32_t>(table, "contour", i, -1, path);
  const auto plane_a = whole<std::int32_t>(table, "plane_a", i, -1, path);
  const auto plane_b = whole<std::int32_t>(table, "plane_b", i, -1, path);
  const auto contrast = whole<std::int8_t>(table, "contrast", i, 0, path);
  for (const auto* number : {&contour, &plane_a, &plane_b})
    if (!*number) return number->error();
  if (!kind) return kind.error();
  if (!contrast) return contrast.error();
  const auto length = not_negative(table, "length", i, path), sigma = not_negative(table, "sigma", i, path);
  if (!length) return length.error();
  if (!sigma) return sigma.error();
  p.kind = contour_kind(*kind);
  p.contour = std::max(*contour, -1);
  p.plane_a = std::max(*plane_a, -1);
  p.plane_b = std::max(*plane_b, -1);
  p.contrast = static_cast<std::int8_t>(std::clamp<int>(*contrast, -1, 1));
  p.length = *length;
  p.sigma = *sigma;
  return {};
}

Eigen::Vector3d rounded_centre(const VectorColumns& position, std::size_t rows) {
  Eigen::Vector3d low = position.at(0), high = low;
  for (std::size_t i = 1; i < rows; ++i)
    low = low.cwiseMin(position.at(i)), high = high.cwiseMax(position.at(i));
  return (0.5 * (low + high)).array().round();
}

/// Files that say nothing of contours may be scans, which would be tracked against as if they were edges.
Status check_not_a_cloud(const PointTable& table, const ContourMap& map) {
  for (const char* name : {"tx", "xg", "kind", "contour", "plane", "plane_a", "length", "sigma", "contrast"})
    if (table.find(name) != nullptr) return {};
  std::vector<Eigen::Vector3f> positions;
  positions.reserve(map.points.size());
  for (const ContourPoint& p : map.points) positions.push_back(p.position);
  if (!lies_on_surfaces(positions)) return {};
  return cloud_error(map.source);
}

Expected<ContourMap> from_table(const PointTable& table, const std::string& path,
                                const ContourReadOptions& options) {
  const std::size_t rows = table.rows();
  const auto position = find_vector(table, {"x", "y", "z"});
  if (!position) return Error{path, "no columns x, y and z", "is it a point cloud?"};
  if (rows == 0) return Error{path, "the map is empty: no contour points", "build or export it again"};
  if (auto status = check_finite(table, path); !status) return status.error();
  VectorColumns normal = find_vector(table, {"nx", "ny", "nz"});
  if (!normal) normal = find_vector(table, {"normal_x", "normal_y", "normal_z"});
  const auto tangent = find_vector(table, {"tx", "ty", "tz"});
  const auto gradient = find_vector(table, {"xg", "yg", "zg"});
  std::vector<Eigen::Vector3d> from_gradients;
  if (!normal && gradient) {
    auto normals = from_gradient(position, gradient, rows, options.gradient, path);
    if (!normals) return normals.error();
    from_gradients = *std::move(normals);
  }
  ContourMap map;
  map.source = path;
  map.anchor = rounded_centre(position, rows);
  map.points.resize(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    ContourPoint& p = map.points[i];
    if (position.at(i).cwiseAbs().maxCoeff() > kFarthest)
      return point_error(path, i, text("lies more than ", kFarthest, " m from the origin"),
                         "give metres in a local frame");
    p.position = (position.at(i) - map.anchor).cast<float>();
    if (normal) p.normal = normal.at(i).cwiseMin(1e9).cwiseMax(-1e9).cast<float>();
    if (!from_gradients.empty()) p.normal = from_gradients[i].cast<float>();
    if (tangent) p.tangent = tangent.at(i).cwiseMin(1e9).cwiseMax(-1e9).cast<float>();
    if (auto status = fill_entries(table, i, path, p); !status) return status.error();
  }
  if (auto status = check_not_a_cloud(table, map); !status) return status.error();
  if (auto status = complete_contours(map); !status) return status.error();
  return map;
}

}  // namespace

Expected<ContourMap> read_contour_map(const std::string& path, const ContourReadOptions& options) {
  const auto kind = point_file_kind(path);
  if (!kind) return kind.error();
  if (*kind == PointFileKind::hdf5) {
    auto map = read_map_h5(path);
    if (!map) return map.error();
    if (auto status = complete_contours(*map); !status) return status.error();
    return map;
  }
  if (*kind == PointFileKind::las) return cloud_error(path);
  if (*kind != PointFileKind::ply && *kind != PointFileKind::pcd)
    return Error{path, "is neither PLY, PCD nor HDF5", "convert the map to one of them"};
  const auto table = *kind == PointFileKind::ply ? read_ply_vertices(path) : read_pcd(path);
  if (!table) return table.error();
  return from_table(*table, path, options);
}

}  // namespace evpose
