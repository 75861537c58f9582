// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "evpose/core/error.h"
#include "evpose/map/place_table.h"

namespace evpose {

/// /places of a map file (see write_map_h5()); nothing where it has none, or is no map file. Errors: a
/// dataset whose checksum, shape or content is wrong (named).
Expected<std::optional<PlaceTable>> read_map_places(const std::string& path);

}  // namespace evpose
