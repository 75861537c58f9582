// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/bench/experiments/contour_looks.h"

namespace evpose::experiments {

/// Draws what is left over of the offsets, as SVG: means over the flight in cells of the image and, seen from
/// above, at the segments of the map.
Status draw_residuals(const std::string& file, ImageSize size, const std::vector<ContourLook>& looks);

}  // namespace evpose::experiments
