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
constexpr std::size_t kBrightnessSample = 1 << 20;

Status visit_table(const std::string& path, const PointBlocks& visit) {
  const auto kind = point_file_kind(path);
  if (!kind) return kind.error();
  if (*kind == PointFileKind::ply) return visit_ply_vertices(path, visit);
  if (*kind == PointFileKind::las) return visit_las(path, visit);
  if (*kind == PointFileKind::pcd) return visit_pcd(path, visit);
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

/// By which the 98th percentile becomes 250.
double brightness_scale(std::vector<double> values) {
  const auto high =
      values.begin() + static_cast<std::ptrdiff_t>(0.98 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), high, values.end());
  return *high > 0 ? 250 / *high : 0;
}

/// Calls visit(position, grey) for each row of a block; the grey is 0 where there is none.
template <class Visit>
Status for_rows(const std::string& path, const PointTable& block, const Visit& visit) {
  const auto *x = block.find("x"), *y = block.find("y"), *z = block.find("z");
  if (x == nullptr || y == nullptr || z == nullptr)
    return Error{path, "no columns x, y and z", "is it a point cloud?"};
  const std::vector<double> values = grey(block);
  for (std::size_t i = 0; i < block.rows(); ++i) {
    const double value = values.empty() || !std::isfinite(values[i]) ? 0 : values[i];
    if (auto status = visit(Eigen::Vector3d((*x)[i], (*y)[i], (*z)[i]), value); !status) return status;
  }
  return {};
}

bool has_grey(const PointTable& block) {
  return block.find("intensity") != nullptr ||
         (block.find("red") != nullptr && block.find("green") != nullptr && block.find("blue") != nullptr);
}

void warn_of(const CloudSurvey& survey, std::size_t rows, double extent) {
  const std::string& path = survey.path;
  if (survey.points < rows)
    log_warning(
        text(path, ": ", rows - survey.points, " of ", rows, " points are not finite and are left out"));
  if (extent > kLargest_m)
    log_warning(
        text(path, ": ", extent, " m across: are these centimetres or millimetres? Metres are expected"));
  if (extent > 0 && extent < kSmallest_m)
    log_warning(text(path, ": only ", extent, " m across: are these kilometres? Metres are expected"));
}

}  // namespace

Expected<CloudSurvey> survey_cloud(const std::string& path, std::size_t most_sampled) {
  CloudSurvey survey(path, most_sampled);
  Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
  Thinned<double> values(kBrightnessSample);
  std::size_t rows = 0;
  bool bright = false;
  const Status read = visit_table(path, [&](const PointTable& block) {
    bright = has_grey(block);
    if (block.viewpoint) survey.viewpoint.emplace(block.viewpoint->data());
    return for_rows(path, block, [&](const Eigen::Vector3d& p, double value) {
      const std::size_t row = rows++;
      if (!p.allFinite()) return Status();
      if (p.cwiseAbs().maxCoeff() > kFarthest_m)
        return Status(
            Error{path, text("point ", row, " (from 0) lies more than ", kFarthest_m, " m from the origin"),
                  "give metres in a local frame"});
      low = low.cwiseMin(p), high = high.cwiseMax(p);
      ++survey.points;
      if (bright) values.add(value);
      if (most_sampled > 0) survey.sample.add(p);
      return Status();
    });
  });
  if (!read) return read.error();
  if (survey.points == 0)
    return Error{path, rows == 0 ? "the cloud is empty: no points" : "no point is finite", "export it again"};
  warn_of(survey, rows, (high - low).maxCoeff());
  survey.anchor = (0.5 * (low + high)).array().round();
  if (bright) survey.brightness_scale = brightness_scale(values.kept());
  return survey;
}

Status visit_cloud(const CloudSurvey& survey, const std::function<Status(const PointCloud& block)>& visit) {
  PointCloud cloud;
  cloud.source = survey.path;
  cloud.anchor = survey.anchor;
  if (survey.viewpoint) cloud.viewpoints.push_back(*survey.viewpoint);
  return visit_table(survey.path, [&](const PointTable& block) {
    cloud.points.clear();
    cloud.brightness.clear();
    Status status = for_rows(survey.path, block, [&](const Eigen::Vector3d& p, double value) {
      if (!p.allFinite()) return Status();
      cloud.points.push_back((p - survey.anchor).cast<float>());
      if (survey.brightness_scale)
        cloud.brightness.push_back(
            static_cast<std::uint8_t>(std::clamp(value * *survey.brightness_scale, 0.0, 255.0)));
      return Status();
    });
    return status ? visit(cloud) : status;
  });
}

Expected<PointCloud> read_cloud(const std::string& path) {
  const auto survey = survey_cloud(path);
  if (!survey) return survey.error();
  PointCloud cloud;
  cloud.source = path;
  cloud.anchor = survey->anchor;
  if (survey->viewpoint) cloud.viewpoints.push_back(*survey->viewpoint);
  cloud.points.reserve(survey->points);
  if (survey->brightness_scale) cloud.brightness.reserve(survey->points);
  const Status read = visit_cloud(*survey, [&](const PointCloud& block) {
    cloud.points.insert(cloud.points.end(), block.points.begin(), block.points.end());
    cloud.brightness.insert(cloud.brightness.end(), block.brightness.begin(), block.brightness.end());
    return Status();
  });
  if (!read) return read.error();
  return cloud;
}

}  // namespace evpose
