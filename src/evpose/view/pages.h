// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/map/contour_map.h"
#include "evpose/view/server.h"

namespace evpose {

/// The viewer's page and all that it loads.
/// `mode`: "live" or "run".
void set_viewer_pages(Server& server, const std::string& mode);

/// The map for the page, thinned out: {"name", "points": [x, y, z, ...], "lines": [...], "triangles": [...]}
/// in map coordinates. `lines`: pairs of neighbours along a contour. Null: no map.
std::string scene_json(const ContourMap* map);

}  // namespace evpose
