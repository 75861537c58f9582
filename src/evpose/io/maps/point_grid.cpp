// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/point_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace evpose {

PointGrid::PointGrid(const std::vector<Eigen::Vector3f>& points, float cell_m) : cell_m_(cell_m) {
  std::vector<std::uint64_t> keys(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) keys[i] = key(points[i], 0, 0, 0);
  order_.resize(points.size());
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(),
            [&](std::uint32_t a, std::uint32_t b) { return std::pair(keys[a], a) < std::pair(keys[b], b); });
  for (std::uint32_t i = 0; i < order_.size();) {
    std::uint32_t end = i + 1;
    while (end < order_.size() && keys[order_[end]] == keys[order_[i]]) ++end;
    cells_[keys[order_[i]]] = {i, end};
    i = end;
  }
}

std::uint64_t PointGrid::key(const Eigen::Vector3f& p, int dx, int dy, int dz) const {
  // 21 bits for each axis; cubes that share a key after wrapping round only add candidates.
  const auto part = [&](float x, int d) {
    const auto i = static_cast<std::int64_t>(std::floor(static_cast<double>(x) / cell_m_)) + d;
    return static_cast<std::uint64_t>(i) & 0x1FFFFF;
  };
  return part(p.x(), dx) << 42 | part(p.y(), dy) << 21 | part(p.z(), dz);
}

float typical_spacing(const std::vector<Eigen::Vector3f>& points) {
  constexpr std::size_t kComparisons = 50'000'000;
  constexpr float kSamePlace2 = 1e-12F;  // m^2
  if (points.size() < 2) return 0;
  const std::size_t samples = std::clamp<std::size_t>(kComparisons / points.size(), 16, 512);
  const std::size_t step = std::max<std::size_t>(points.size() / samples, 1);
  std::vector<float> nearest;
  for (std::size_t i = 0; i < points.size(); i += step) {
    float best = std::numeric_limits<float>::max();
    for (const auto& p : points) {
      const float d2 = (p - points[i]).squaredNorm();
      if (d2 > kSamePlace2 && d2 < best) best = d2;
    }
    if (best < std::numeric_limits<float>::max()) nearest.push_back(std::sqrt(best));
  }
  if (nearest.empty()) return 0;
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  return *middle;
}

}  // namespace evpose
