// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "evpose/map_learn/map_changes.h"

namespace evpose {

/// A line for people of each kind of change.
std::string words_of(const map_learn::MapChanges& changes);
/// Counts, metres, and each change with its place.
nlohmann::ordered_json json_of(const map_learn::MapChanges& changes);

}  // namespace evpose
