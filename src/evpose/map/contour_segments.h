// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose {

/// A map's contours cut into short segments, each of which looks much the same along its length. What is
/// learnt about a contour is learnt for each segment: its contrast (contrast segments) and its offset from
/// the map (offset segments).
struct ContourSegments {
  std::vector<std::uint32_t> of_point;  ///< number of the segment of each map point
  std::uint32_t count = 0;
};

/// Length of a contrast segment: so short that the surfaces on both sides hardly change along it.
inline constexpr double kContrastSegment_m = 0.12;

/// Points belong to one segment if they lie on one contour (the map's number, or, without one, a chain of
/// close points on one line and one plane) and in one cube of edge `segment_m`.
ContourSegments cut_into_segments(const ContourMap& map, double segment_m = kContrastSegment_m);

}  // namespace evpose
