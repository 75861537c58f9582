// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/view_points.h"

#include <algorithm>
#include <cmath>

namespace evpose::map_build {
namespace {

constexpr double kPointsInCell = 4;
constexpr double kFewestCells = 32, kMostCells = 256;  // along a side
constexpr float kNearest_m = 0.05F;                    // points nearer are of the scanner

}  // namespace

View::View(const Eigen::Vector3d& eye, std::span<const Eigen::Vector3f> points) : eye_(eye) {
  const double cells = std::sqrt(static_cast<double>(points.size()) / (6 * kPointsInCell));
  side_ = static_cast<Eigen::Index>(std::clamp(cells, kFewestCells, kMostCells));
  nearest_.assign(static_cast<std::size_t>(6 * side_ * side_), Eigen::Vector3f::Zero());
  const Eigen::Vector3f from = eye.cast<float>();
  for (const Eigen::Vector3f& p : points) {
    const Eigen::Vector3f ray = p - from;
    if (ray.squaredNorm() < kNearest_m * kNearest_m) continue;
    const Cell cell = cell_of(ray);
    Eigen::Vector3f& nearest = nearest_[number(cell.face, cell.column, cell.row)];
    if (nearest.isZero() || ray.squaredNorm() < nearest.squaredNorm()) nearest = ray;
  }
}

View::Cell View::cell_of(const Eigen::Vector3f& direction) const {
  Eigen::Index axis = 0;
  const float largest = direction.cwiseAbs().maxCoeff(&axis);
  const auto place = [&](Eigen::Index k) {
    const float share = 0.5F * (direction[k] / largest + 1);
    return std::clamp(static_cast<Eigen::Index>(share * static_cast<float>(side_)), Eigen::Index{0},
                      side_ - 1);
  };
  return {2 * axis + (direction[axis] > 0 ? 1 : 0), place((axis + 1) % 3), place((axis + 2) % 3)};
}

bool View::hides(const Eigen::Vector3d& x, const FittedPlane& plane, double margin_m) const {
  const Eigen::Vector3d ray = x - eye_;
  const double range = ray.norm();
  const Cell cell = cell_of(ray.cast<float>());
  // The eight cells around, too: a cell may be empty by chance.
  for (Eigen::Index row = std::max(cell.row - 1, Eigen::Index{0}); row <= std::min(cell.row + 1, side_ - 1);
       ++row)
    for (Eigen::Index column = std::max(cell.column - 1, Eigen::Index{0});
         column <= std::min(cell.column + 1, side_ - 1); ++column) {
      const Eigen::Vector3d nearest = nearest_[number(cell.face, column, row)].cast<double>();
      if (nearest.isZero() || nearest.norm() > range - margin_m) continue;
      if (std::abs(plane.distance(eye_ + nearest)) > margin_m) return true;
    }
  return false;
}

bool hidden_from_all(std::span<const View> views, const Eigen::Vector3d& x, const FittedPlane& plane,
                     double margin_m) {
  return !views.empty() && std::all_of(views.begin(), views.end(),
                                       [&](const View& view) { return view.hides(x, plane, margin_m); });
}

}  // namespace evpose::map_build
