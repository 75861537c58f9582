// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"

namespace evpose {

/// Makes a map of points as read fit to track against: normals and tangents unit and perpendicular to each
/// other, tangents that are zero estimated from neighbours of the same contour (for isolated points: of the
/// same plane and like normal), lengths that are zero from the distances to the neighbours along the tangent.
/// Points whose tangent cannot be told are left out with a warning. Everything in `map` must be finite,
/// positions within 1e7 m. Errors: no points, or most of them without a tangent.
Status complete_contours(ContourMap& map);

}  // namespace evpose
