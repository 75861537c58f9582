// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/map_accuracy.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <numbers>

#include "evpose/map/visible_set.h"

namespace evpose {
namespace {

constexpr double kCorrelated_px = 0.35;  // as in registration: correlated error of neighbouring events
constexpr double kCell_px = 32;
constexpr double kUnknown = 1e3;        // m or rad: prior sigma of an unknown pose
constexpr double kNoPosition_mm = 1e3;  // a sigma beyond tells no position

}  // namespace

ViewAccuracy expected_accuracy(const ContourMap& map, std::span<const std::uint32_t> points,
                               const Camera& camera, const Pose& T_map_cam) {
  struct Cluster {
    Matrix6d information = Matrix6d::Zero();  // of its points, each of weight one
    double variance = 0;
    int count = 0;
  };
  std::map<std::array<int, 3>, Cluster> clusters;
  const Pose T_cam_map = T_map_cam.inverse();
  const Eigen::Matrix3d R = T_cam_map.rotation();
  ViewAccuracy out;
  for (const std::uint32_t i : points) {
    const Eigen::Vector3d x = T_cam_map * map.position(i);
    Matrix23d jacobian;
    const auto pixel = camera.project(x, &jacobian);
    if (!pixel || !camera.size().contains(*pixel)) continue;
    const Eigen::Vector2d along = jacobian * (R * map.points[i].tangent.cast<double>());
    if (!(along.squaredNorm() > 0)) continue;
    const Eigen::Vector2d across = Eigen::Vector2d(-along.y(), along.x()).normalized();
    const Eigen::RowVector3d a = across.transpose() * jacobian;
    Vector6d j;
    j.head<3>() = (a * R).transpose();
    j.tail<3>() = -(a * so3::hat(x)).transpose();
    const double mpp = x.z() / camera.focal_px();
    const double sigma_px = static_cast<double>(map.points[i].sigma) / mpp;
    const double angle =
        std::fmod(std::atan2(across.y(), across.x()) + 2 * std::numbers::pi, std::numbers::pi);
    Cluster& cluster =
        clusters[{static_cast<int>(pixel->x() / kCell_px), static_cast<int>(pixel->y() / kCell_px),
                  static_cast<int>(angle / (std::numbers::pi / 4))}];
    cluster.information += j * j.transpose();
    cluster.variance += kCorrelated_px * kCorrelated_px + sigma_px * sigma_px;
    ++cluster.count;
    ++out.points;
  }
  Matrix6d information = Matrix6d::Identity() / (kUnknown * kUnknown);
  for (const auto& [key, cluster] : clusters) information += cluster.information / cluster.variance;
  out.clusters = clusters.size();
  const Matrix6d covariance = information.ldlt().solve(Matrix6d::Identity());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> place(covariance.topLeftCorner<3, 3>()),
      turn(covariance.bottomRightCorner<3, 3>());
  out.worst_mm = 1e3 * std::sqrt(place.eigenvalues()[2]);
  out.mean_mm = 1e3 * std::sqrt(place.eigenvalues().sum() / 3);
  out.worst_axis = place.eigenvectors().col(2);
  out.angle_deg = 180 / std::numbers::pi * std::sqrt(turn.eigenvalues()[2]);
  return out;
}

namespace {

AccuracyShares shares_of(std::span<const ViewAccuracy> cells, double weight) {
  AccuracyShares out;
  for (const ViewAccuracy& cell : cells) {
    out.to_5mm += cell.worst_mm <= 5 ? weight : 0;
    out.to_15mm += cell.worst_mm <= 15 ? weight : 0;
    out.to_50mm += cell.worst_mm <= 50 ? weight : 0;
    out.none += cell.worst_mm <= kNoPosition_mm ? 0 : weight;
  }
  return out;
}

}  // namespace

AccuracyShares shares_of(const AccuracySlice& slice) {
  return shares_of(slice.cells, 1 / static_cast<double>(std::max<std::size_t>(1, slice.cells.size())));
}

AccuracyShares shares_of(const AccuracySurvey& survey) {
  std::vector<ViewAccuracy> all;
  for (const AccuracySlice& slice : survey.slices)
    all.insert(all.end(), slice.cells.begin(), slice.cells.end());
  return shares_of(all, 1 / static_cast<double>(std::max<std::size_t>(1, all.size())));
}

const Camera& survey_camera() {
  static const auto camera = make_camera({460, 460, 319.5, 239.5, "none", {}, {640, 480}});
  return **camera;
}

std::vector<double> survey_heights(const ContourMap& map) {
  double low = map.position(0).z(), high = low;
  for (std::size_t i = 1; i < map.points.size(); ++i)
    low = std::min(low, map.position(i).z()), high = std::max(high, map.position(i).z());
  return {low + 0.25 * (high - low), low + 0.5 * (high - low)};
}

AccuracySurvey survey_accuracy(const ContourMap& map, const Camera& camera, double pitch_down_rad,
                               std::span<const double> heights_m, int cells) {
  AccuracySurvey out;
  const ContourIndex index(map);
  out.index_bytes =
      index.cubes().size() * sizeof(ContourIndex::Cube) + index.order().size() * sizeof(std::uint32_t);
  VisibleSetConfig config;
  config.margin_px = 0;
  VisibleSet visible(index, camera, config);
  Eigen::Vector3d low = map.position(0), high = low;
  for (std::size_t i = 1; i < map.points.size(); ++i)
    low = low.cwiseMin(map.position(i)), high = high.cwiseMax(map.position(i));
  const double cell_m = std::max((high - low).head<2>().maxCoeff(), 0.1) / cells;
  int queries = 0;
  const auto start = std::chrono::steady_clock::now();
  for (const double height : heights_m) {
    AccuracySlice slice;
    slice.height_m = height;
    slice.cell_m = cell_m;
    slice.x0 = low.x(), slice.y0 = low.y();
    slice.columns = std::max(1, static_cast<int>(std::ceil((high.x() - low.x()) / cell_m)));
    slice.rows = std::max(1, static_cast<int>(std::ceil((high.y() - low.y()) / cell_m)));
    for (int r = 0; r < slice.rows; ++r)
      for (int c = 0; c < slice.columns; ++c) {
        std::array<ViewAccuracy, 4> views;
        for (int k = 0; k < 4; ++k) {
          const double yaw = k * std::numbers::pi / 2;
          const Eigen::Vector3d forward(std::cos(yaw) * std::cos(pitch_down_rad),
                                        std::sin(yaw) * std::cos(pitch_down_rad), -std::sin(pitch_down_rad));
          const Eigen::Vector3d right(std::sin(yaw), -std::cos(yaw), 0);
          Eigen::Matrix3d axes;
          axes << right, forward.cross(right), forward;
          const Pose T_map_cam{Eigen::Quaterniond(axes),
                               {slice.x0 + (c + 0.5) * cell_m, slice.y0 + (r + 0.5) * cell_m, height}};
          views[static_cast<std::size_t>(k)] =
              expected_accuracy(map, visible.choose(T_map_cam), camera, T_map_cam);
          ++queries;
        }
        std::sort(views.begin(), views.end(),
                  [](const auto& a, const auto& b) { return a.worst_mm < b.worst_mm; });
        slice.cells.push_back(views[1]);
      }
    out.slices.push_back(std::move(slice));
  }
  out.query_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count() /
                 std::max(queries, 1);
  return out;
}

}  // namespace evpose
