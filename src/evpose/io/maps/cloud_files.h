// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/map/point_cloud.h"

namespace evpose {

/// A cloud of surface points from PLY, PCD or LAS, by content. Brightness comes from `intensity` (scaled so
/// that its 98th percentile is nearly white) or from red, green and blue. Points that are not finite are left
/// out with one warning that counts them; a size that suggests another unit than metres is warned of. Errors:
/// what the formats' readers say, no points, points beyond 1e7 m.
Expected<PointCloud> read_cloud(const std::string& path);

}  // namespace evpose
