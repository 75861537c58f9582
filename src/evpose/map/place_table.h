// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose {

/// What hides the points of a map from places all over it, as a map file keeps it: it takes seconds to find
/// out, and all else that PlaceIndex has follows from the map at once.
struct PlaceTable {
  std::uint64_t view = 0;                         ///< view_fingerprint() of the map
  double near_m = 0, far_m = 0, grazing_sin = 0;  ///< as of VisibleSetConfig
  Eigen::AlignedBox3d box;                        ///< that the places divide, map frame
  static constexpr std::uint32_t kNoPlace = ~0U;
  std::vector<std::uint32_t> looked_at;  ///< of each place: numbers of points; kNoPlace: hardly any is seen
  /// Of each place from a new byte on, a bit for each of its points, by their numbers, the lowest first.
  std::vector<std::uint8_t> seen;
};

/// Of what decides which contours are seen from where: points and occluders.
std::uint64_t view_fingerprint(const ContourMap& map);

}  // namespace evpose
