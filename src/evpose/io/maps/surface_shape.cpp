// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/surface_shape.h"

#include <algorithm>
#include <cmath>

#include "evpose/io/maps/point_grid.h"

namespace evpose {
namespace {

constexpr std::size_t kFewest = 1000;
constexpr std::size_t kSample = 300;
constexpr float kNear = 3;  // spacings; dense enough to count, small beside the distance of parallel edges
/// Between lines, 1 to 1.6 on maps with parallel edges and bands of points, and scans of surfaces, from 1.75.
constexpr double kSurfaceDimension = 1.68;
constexpr float kLeastSpacing_m = 1e-4F;  // of cubes, whose keys have a range

}  // namespace

bool lies_on_surfaces(const std::vector<Eigen::Vector3f>& points) {
  if (points.size() < kFewest) return false;
  const float near_m = kNear * std::max(typical_spacing(points), kLeastSpacing_m);
  const PointGrid grid(points, 2 * near_m);
  std::vector<double> dimensions;
  for (std::size_t i = 0; i < points.size(); i += points.size() / kSample) {
    int within = 0, within_twice = 0;
    grid.for_candidates(points[i], [&](std::uint32_t j) {
      const float distance = (points[j] - points[i]).norm();
      within += distance < near_m ? 1 : 0;
      within_twice += distance < 2 * near_m ? 1 : 0;
    });
    dimensions.push_back(std::log2(std::max(within_twice, 1)) - std::log2(std::max(within, 1)));
  }
  const auto middle = dimensions.begin() + static_cast<std::ptrdiff_t>(dimensions.size() / 2);
  std::nth_element(dimensions.begin(), middle, dimensions.end());
  return *middle > kSurfaceDimension;
}

}  // namespace evpose
