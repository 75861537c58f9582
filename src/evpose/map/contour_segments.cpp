// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/contour_segments.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

namespace evpose {
namespace {

constexpr float kLink_m = 0.05F;     // longest step between neighbours of a chain
constexpr float kOffLine_m = 3e-3F;  // largest distance of a neighbour from the line
constexpr float kSameDirection = 0.98F;

using Cell = std::array<std::int32_t, 3>;

Cell cell_of(const Eigen::Vector3f& p, float edge) {
  const Eigen::Vector3f c = (p / edge).array().floor();
  return {static_cast<std::int32_t>(c.x()), static_cast<std::int32_t>(c.y()),
          static_cast<std::int32_t>(c.z())};
}

/// Disjoint sets of points.
class Chains {
 public:
  explicit Chains(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

bool neighbours(const ContourPoint& a, const ContourPoint& b) {
  if (a.plane_a != b.plane_a || std::abs(a.tangent.dot(b.tangent)) < kSameDirection) return false;
  const Eigen::Vector3f d = b.position - a.position;
  const float along = d.dot(a.tangent);
  return std::abs(along) <= kLink_m && (d - along * a.tangent).squaredNorm() <= kOffLine_m * kOffLine_m;
}

void join_neighbours(const std::vector<ContourPoint>& points, Chains& chains) {
  std::vector<std::pair<Cell, std::uint32_t>> sorted;
  for (std::uint32_t i = 0; i < points.size(); ++i)
    if (points[i].contour < 0) sorted.push_back({cell_of(points[i].position, kLink_m), i});
  std::sort(sorted.begin(), sorted.end());
  // Each pair of neighbouring cells once: the cell itself and those that come after it.
  for (auto first = sorted.begin(); first != sorted.end();) {
    const Cell cell = first->first;
    auto last = first;
    while (last != sorted.end() && last->first == cell) ++last;
    for (std::int32_t dx = 0; dx <= 1; ++dx)
      for (std::int32_t dy = -1; dy <= 1; ++dy) {
        const std::pair<Cell, std::uint32_t> low{{cell[0] + dx, cell[1] + dy, cell[2] - 1}, 0};
        const Cell high{cell[0] + dx, cell[1] + dy, cell[2] + 1};
        for (auto other = std::lower_bound(first, sorted.end(), low);
             other != sorted.end() && other->first <= high; ++other)
          for (auto own = first; own != last; ++own)
            if (own->second != other->second && neighbours(points[own->second], points[other->second]))
              chains.join(own->second, other->second);
      }
    first = last;
  }
}

}  // namespace

ContourSegments cut_into_segments(const ContourMap& map, double segment_m) {
  const std::vector<ContourPoint>& points = map.points;
  Chains chains(points.size());
  join_neighbours(points, chains);
  struct Key {
    std::int64_t contour;
    Cell cube;
    std::uint32_t point;
    bool operator<(const Key& o) const {
      return std::tie(contour, cube, point) < std::tie(o.contour, o.cube, o.point);
    }
  };
  std::vector<Key> keys(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const std::int64_t contour = points[i].contour;
    // Chains are numbered apart from the map's contours.
    keys[i] = {contour >= 0 ? contour : -1 - static_cast<std::int64_t>(chains.find(i)),
               cell_of(points[i].position, static_cast<float>(segment_m)), i};
  }
  std::sort(keys.begin(), keys.end());
  ContourSegments out;
  out.of_point.resize(points.size());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (k > 0 && (keys[k].contour != keys[k - 1].contour || keys[k].cube != keys[k - 1].cube)) ++out.count;
    out.of_point[keys[k].point] = out.count;
  }
  if (!keys.empty()) ++out.count;
  return out;
}

}  // namespace evpose
