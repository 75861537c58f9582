// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"

namespace evpose {

/// What the columns xg yg zg of semi-dense edge clouds hold (formats 2.2): a second point, displaced along
/// the gradient, or a direction. `automatic` decides by their distances and says which with log_detail.
enum class GradientColumns { automatic, point, direction };

struct ContourReadOptions {
  GradientColumns gradient = GradientColumns::automatic;
};

/// A map to track against, complete: finite points, unit tangents (estimated from neighbours where absent),
/// normals unit and across the tangent or zero where unknown, lengths (from the spacing where absent). Points
/// whose tangent cannot be told are left out with a warning. By content: our contours.ply, any PLY or PCD
/// cloud of edge points with or without normals, or map.h5. Errors: no points, not finite (which point), most
/// points without a tangent, gradient columns in another frame, points on surfaces in a file that says
/// nothing of contours, as scans have them.
Expected<ContourMap> read_contour_map(const std::string& path, const ContourReadOptions& options = {});

}  // namespace evpose
