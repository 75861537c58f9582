// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evpose/map_build/line_segment.h"

namespace evpose::map_build {

/// Appends points about `spacing_m` apart along a segment to the contour of that number. `contrast`: of the
/// step from face a to face b, 0 if it is not known.
void add_points(const LineSegment& segment, std::int32_t number, std::int8_t contrast, double spacing_m,
                ContourMap& map);

}  // namespace evpose::map_build
