// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>

#include "evpose/map_build/line_segment.h"
#include "evpose/map_build/surface_points.h"

namespace evpose::map_build {

class Neighbours;

/// Step of brightness from a crease's face a to its face b: +1 brighter, -1 darker, 0 not told: no second
/// face, too few points, or a step within the scatter. `brightness`: of each surface point.
std::int8_t contrast_of(const LineSegment& segment, const SurfacePoints& surface, const Neighbours& tree,
                        std::span<const std::uint8_t> brightness);

}  // namespace evpose::map_build
