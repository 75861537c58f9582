// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

namespace evpose {

/// Points sorted into cubes, to find neighbours. Positions within 1e7 m of the origin.
class PointGrid {
 public:
  /// `points` must outlive the grid.
  PointGrid(const std::vector<Eigen::Vector3f>& points, float cell_m);

  /// Calls visit(index) for the points in the cube of `p` and in the 26 around it: all within one cell's
  /// length, and some beyond. Of a crowded cube only some, evenly in the order of the points, so that the
  /// cost is bounded.
  template <class Visit>
  void for_candidates(const Eigen::Vector3f& p, const Visit& visit) const {
    for (int k = 0; k < 27; ++k) {
      const auto cell = cells_.find(key(p, k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
      if (cell == cells_.end()) continue;
      const auto [begin, end] = cell->second;
      const std::uint32_t step = 1 + (end - begin) / kMostPerCell;
      for (std::uint32_t i = begin; i < end; i += step) visit(order_[i]);
    }
  }

 private:
  static constexpr std::uint32_t kMostPerCell = 256;
  std::uint64_t key(const Eigen::Vector3f& p, int dx, int dy, int dz) const;

  float cell_m_;
  std::vector<std::uint32_t> order_;  ///< indices of points, cube by cube
  std::unordered_map<std::uint64_t, std::pair<std::uint32_t, std::uint32_t>> cells_;
};

/// Median distance from a point to its nearest other one; 0 when there are not two different points. Of a
/// sample, evenly spread over the order of the points.
float typical_spacing(const std::vector<Eigen::Vector3f>& points);

}  // namespace evpose
