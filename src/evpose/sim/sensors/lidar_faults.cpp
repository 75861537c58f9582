// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/lidar_faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "evpose/sim/sensors/lidar.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

using Eigen::Vector3d;

constexpr std::uint64_t kDriftStream = 1ULL << 44, kPartsStream = (1ULL << 44) + 1;
constexpr double kCell_m = 0.1;
constexpr double kLeastRadius_m = 0.3, kMostRadius_m = 1.5;

using Cell = std::array<std::int32_t, 3>;

Cell cell_of(const CloudPoint& point) {
  Cell cell{};
  for (int k = 0; k < 3; ++k)
    cell[static_cast<std::size_t>(k)] =
        static_cast<std::int32_t>(std::floor(static_cast<double>(point.position[k]) / kCell_m));
  return cell;
}

double squared_distance(const Cell& a, const Cell& b) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += static_cast<double>(a[k] - b[k]) * (a[k] - b[k]);
  return kCell_m * kCell_m * sum;
}

}  // namespace

std::vector<Pose> registration_drift(const Trajectory& trajectory, const LidarConfig& config,
                                     std::uint64_t seed) {
  constexpr double kWay_m = 10, kLever_m = 10;
  constexpr int kSteps = 10;  // of the way's length within a scan
  Random random(seed, kDriftStream);
  const auto normal = [&](double sigma) {
    const double x = random.normal(), y = random.normal(), z = random.normal();
    return Vector3d(sigma * x, sigma * y, sigma * z);
  };
  std::vector<Pose> drift;
  Pose now;
  Vector3d at = trajectory.at(0).T_map_body.p;
  const double step_s = config.scan_s / kSteps;
  for (int scan = 0; scan * config.scan_s < trajectory.duration_s() - 1e-9; ++scan) {
    double way_m = 0;
    for (int i = 1; i <= kSteps; ++i) {
      const double t_s = std::min(scan * config.scan_s + i * step_s, trajectory.duration_s());
      const Vector3d next = trajectory.at(t_s).T_map_body.p;
      way_m += (next - at).norm();
      at = next;
    }
    const double sigma_m = 1e-3 * config.registration_drift_mm_per_10m * std::sqrt(way_m / kWay_m);
    now.p += normal(sigma_m);
    now.q = so3::exp(normal(sigma_m / kLever_m)) * now.q;
    drift.push_back(now);
  }
  return drift;
}

void leave_out_parts(double fraction, std::uint64_t seed, std::vector<CloudPoint>& cloud) {
  if (!(fraction > 0)) return;
  std::vector<Cell> cells;
  cells.reserve(cloud.size());
  for (const CloudPoint& point : cloud) cells.push_back(cell_of(point));
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  std::vector<bool> dropped(cells.size());
  auto left = static_cast<std::size_t>(std::llround(fraction * static_cast<double>(cells.size())));
  Random random(seed, kPartsStream);
  while (left > 0) {
    const auto centre = static_cast<std::size_t>(random.uniform() * static_cast<double>(cells.size()));
    const double radius = random.uniform(kLeastRadius_m, kMostRadius_m);
    if (dropped[centre]) continue;
    std::vector<std::pair<double, std::size_t>> part;  // by distance
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const double away = squared_distance(cells[i], cells[centre]);
      if (!dropped[i] && away <= radius * radius) part.emplace_back(away, i);
    }
    std::sort(part.begin(), part.end());
    part.resize(std::min(part.size(), left));
    for (const auto& cell : part) dropped[cell.second] = true;
    left -= part.size();
  }
  std::erase_if(cloud, [&](const CloudPoint& point) {
    const auto cell = std::lower_bound(cells.begin(), cells.end(), cell_of(point));
    return dropped[static_cast<std::size_t>(cell - cells.begin())];
  });
}

}  // namespace evpose::sim
