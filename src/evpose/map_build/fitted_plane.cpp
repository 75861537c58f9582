// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/fitted_plane.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "evpose/map_build/median.h"
#include "evpose/map_build/surface_points.h"

namespace evpose::map_build {

double FittedPlane::sigma_at(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d lever = x - centre;
  return std::sqrt(offset_variance + lever.dot(tilt_covariance * lever));
}

double FittedPlane::tilt_sigma_rad() const {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(tilt_covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(solver.eigenvalues()[2], 0.0));
}

double noise_on(const SurfacePoints& surface, const FittedPlane& plane) {
  if (surface.noise_m.empty() || plane.points.empty()) return surface.scale.noise_m;
  std::vector<double> noise;
  const std::size_t step = std::max<std::size_t>(1, plane.points.size() / 1000);
  for (std::size_t i = 0; i < plane.points.size(); i += step)
    noise.push_back(surface.noise_at(plane.points[i]));
  return median(noise);
}

double unevenness_m(const SurfacePoints& surface, const FittedPlane& plane) {
  constexpr double kCellSpacings = 5;
  constexpr double kFewestInCell = 8;
  const double cell_m = kCellSpacings * plane.spacing_m;
  if (!(cell_m > 0)) return 0;
  const Eigen::Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
  std::map<std::pair<int, int>, Eigen::Vector3d> cells;  // count, sum and squares of heights
  for (const std::uint32_t i : plane.points) {
    const Eigen::Vector3d x = surface.position[i].cast<double>() - plane.centre;
    const double height = plane.normal.dot(x);
    const auto key = std::pair(static_cast<int>(std::floor(u.dot(x) / cell_m)),
                               static_cast<int>(std::floor(v.dot(x) / cell_m)));
    auto [cell, is_new] = cells.try_emplace(key, Eigen::Vector3d::Zero());
    cell->second += Eigen::Vector3d(1, height, height * height);
  }
  double scatter = 0, expected = 0, used = 0;
  for (const auto& [key, sums] : cells) {
    const double n = sums[0];
    if (n < kFewestInCell) continue;
    const double mean = sums[1] / n;
    scatter += mean * mean;
    expected += (sums[2] / n - mean * mean) / (n - 1);
    used += 1;
  }
  return used > 0 ? std::sqrt(std::max(scatter - expected, 0.0) / used) : 0;
}

}  // namespace evpose::map_build
