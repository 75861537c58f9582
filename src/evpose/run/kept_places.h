// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"
#include "evpose/relocalization/place_cache.h"

namespace evpose {

/// A cache with what a map's file keeps of its places, where it keeps any; else null. A file whose places are
/// of the map before it was changed is told to `findings`. Errors: as of read_map_places().
Expected<std::shared_ptr<PlaceCache>> kept_places(const std::string& path, const ContourMap& map,
                                                  std::vector<Error>& findings);

}  // namespace evpose
