// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"

namespace evpose {

/// map.h5 1.0. Polygons become triangles of the occluder mesh. A contour of one row is an isolated point, as
/// is a row that belongs to no contour. Errors: not a map file, another major version or unit, an unknown
/// required feature, a dataset whose checksum, shape or content is wrong (named).
Expected<ContourMap> read_map_h5(const std::string& path);

/// Points of one contour that differ in kind, planes or contrast are written as several contours; lengths of
/// points are kept as the length of their contour.
Status write_map_h5(const std::string& path, const ContourMap& map);

}  // namespace evpose
