// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/map/contour_map.h"

namespace evpose {

/// The area inside the rings and outside of their holes as triangles, for the depth buffer. Rings that cross
/// themselves or each other are taken by the even-odd rule; rings of less than three corners are left out.
TriangleMesh triangulated(const std::vector<MapPlane>& planes, const std::vector<MapPolygon>& polygons);

}  // namespace evpose
