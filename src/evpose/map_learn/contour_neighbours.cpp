// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/contour_neighbours.h"

#include <algorithm>
#include <cmath>

namespace evpose::map_learn {
namespace {

constexpr float kCube_m = 0.05F;
constexpr float kParallel = 0.9F;      // cosine
constexpr float kAlongside_m = 0.03F;  // along the line

}  // namespace

ContourNeighbours::ContourNeighbours(const ContourMap& map) : map_(map) {
  for (std::uint32_t i = 0; i < map.points.size(); ++i) sorted_.emplace_back(key(map.points[i].position), i);
  std::sort(sorted_.begin(), sorted_.end());
}

ContourNeighbours::Key ContourNeighbours::key(const Eigen::Vector3f& p) {
  return {static_cast<std::int32_t>(std::floor(p.x() / kCube_m)),
          static_cast<std::int32_t>(std::floor(p.y() / kCube_m)),
          static_cast<std::int32_t>(std::floor(p.z() / kCube_m))};
}

bool ContourNeighbours::beside(const Eigen::Vector3f& p, const Eigen::Vector3f& tangent,
                               float within_m) const {
  const float reach = std::min(within_m, kCube_m);
  for (int dx = -1; dx <= 1; ++dx)
    for (int dy = -1; dy <= 1; ++dy)
      for (int dz = -1; dz <= 1; ++dz) {
        const Key k = key(p + kCube_m * Eigen::Vector3f(static_cast<float>(dx), static_cast<float>(dy),
                                                        static_cast<float>(dz)));
        for (auto it = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(k, std::uint32_t{0}));
             it != sorted_.end() && it->first == k; ++it) {
          const ContourPoint& c = map_.points[it->second];
          if (std::abs(c.tangent.dot(tangent)) < kParallel) continue;
          const Eigen::Vector3f d = c.position - p;
          const float along = d.dot(tangent);
          if (std::abs(along) < kAlongside_m && (d - along * tangent).norm() < reach) return true;
        }
      }
  return false;
}

}  // namespace evpose::map_learn
