// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/map/contour_map.h"
#include "evpose/report/map_accuracy.h"

namespace evpose {

/// The quality report of a map: one HTML file that needs nothing else. Plan and two elevations of planes and
/// contours, lengths and errors by kind, the largest planes, and the expected accuracy of the pose over the
/// slices.
std::string map_page(const ContourMap& map, const AccuracySurvey& survey, double pitch_down_rad);

/// One of its pictures alone (SVG): 0 the plan, 1 the elevation along y, 2 along x.
std::string map_drawing(const ContourMap& map, int view);

}  // namespace evpose
