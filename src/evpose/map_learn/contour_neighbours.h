// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose::map_learn {

/// A map's contours by cubes of 5 cm, to find those that run beside a line. The map is kept by reference.
class ContourNeighbours {
 public:
  explicit ContourNeighbours(const ContourMap& map);
  /// Whether a contour runs beside the line at `p` (relative to the map's anchor) along `tangent`, at most
  /// `within_m` or 5 cm away.
  bool beside(const Eigen::Vector3f& p, const Eigen::Vector3f& tangent, float within_m) const;

 private:
  using Key = std::array<std::int32_t, 3>;
  static Key key(const Eigen::Vector3f& p);

  const ContourMap& map_;
  std::vector<std::pair<Key, std::uint32_t>> sorted_;
};

}  // namespace evpose::map_learn
