// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/cloud_files.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/log.h"
#include "evpose/io/maps/las.h"
#include "evpose/io/maps/pcd.h"
#include "evpose/io/maps/ply.h"

namespace evpose {
namespace {

constexpr double kFarthest_m = 1e7;  // from the origin
constexpr double kSmallest_m = 0.3;  // scenes that someone flies in are larger
constexpr double kLargest_m = 5000;  // scenes that someone flies in are smaller

Expected<PointTable> read_table(const std::string& path) {
  const auto kind = point_file_kind(path);
  if (!kind) return kind.error();
  if (*kind == PointFileKind::ply) return read_ply_vertices(path);
  if (*kind == PointFileKind::las) return read_las(path);
  if (*kind == PointFileKind::pcd) return read_pcd(path);
  return Error{path, "is neither PLY, PCD nor LAS", "convert the cloud to one of them"};
}

/// Grey of each row, empty if there is neither intensity nor colour.
std::vector<double> grey(const PointTable& table) {
  if (const auto* intensity = table.find("intensity")) return *intensity;
  const auto *red = table.find("red"), *green = table.find("green"), *blue = table.find("blue");
  if (red == nullptr || green == nullptr || blue == nullptr) return {};
  std::vector<double> out(table.rows());
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = 0.299 * (*red)[i] + 0.587 * (*green)[i] + 0.114 * (*blue)[i];
  return out;
}

/// Scaled so that the 98th percentile becomes 250.
std::vector<std::uint8_t> to_bytes(const std::vector<double>& values) {
  std::vector<double> sorted = values;
  const auto high =
      sorted.begin() + static_cast<std::ptrdiff_t>(0.98 * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), high, sorted.end());
  const double scale = *high > 0 ? 250 / *high : 0;
  std::vector<std::uint8_t> out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    out[i] = static_cast<std::uint8_t>(std::clamp(values[i] * scale, 0.0, 255.0));
  return out;
}

}  // namespace

Expected<PointCloud> read_cloud(const std::string& path) {
  auto table = read_table(path);
  if (!table) return table.error();
  const auto *x = table->find("x"), *y = table->find("y"), *z = table->find("z");
  if (x == nullptr || y == nullptr || z == nullptr)
    return Error{path, "no columns x, y and z", "is it a point cloud?"};
  const auto at = [&](std::size_t i) { return Eigen::Vector3d((*x)[i], (*y)[i], (*z)[i]); };
  std::size_t kept = 0;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
  for (std::size_t i = 0; i < table->rows(); ++i) {
    const Eigen::Vector3d p = at(i);
    if (!p.allFinite()) continue;
    if (p.cwiseAbs().maxCoeff() > kFarthest_m)
      return Error{path, text("point ", i, " (from 0) lies more than ", kFarthest_m, " m from the origin"),
                   "give metres in a local frame"};
    low = low.cwiseMin(p), high = high.cwiseMax(p);
    ++kept;
  }
  if (kept == 0)
    return Error{path, table->rows() == 0 ? "the cloud is empty: no points" : "no point is finite",
                 "export it again"};
  if (kept < table->rows())
    log_warning(text(path, ": ", table->rows() - kept, " of ", table->rows(),
                     " points are not finite and are left out"));
  const double extent = (high - low).maxCoeff();
  if (extent > kLargest_m)
    log_warning(
        text(path, ": ", extent, " m across: are these centimetres or millimetres? Metres are expected"));
  if (extent > 0 && extent < kSmallest_m)
    log_warning(text(path, ": only ", extent, " m across: are these kilometres? Metres are expected"));
  PointCloud cloud;
  cloud.source = path;
  cloud.anchor = (0.5 * (low + high)).array().round();
  if (table->viewpoint) cloud.viewpoints.emplace_back(table->viewpoint->data());
  const std::vector<double> values = grey(*table);
  std::vector<double> of_kept;
  cloud.points.reserve(kept);
  for (std::size_t i = 0; i < table->rows(); ++i) {
    const Eigen::Vector3d p = at(i);
    if (!p.allFinite()) continue;
    cloud.points.push_back((p - cloud.anchor).cast<float>());
    if (!values.empty()) of_kept.push_back(std::isfinite(values[i]) ? values[i] : 0);
  }
  if (!of_kept.empty()) cloud.brightness = to_bytes(of_kept);
  return cloud;
}

}  // namespace evpose
