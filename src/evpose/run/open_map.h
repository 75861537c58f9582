// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/core/error.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// A map to track against: all of it, or the part around the start and where the others are had from.
struct OpenedMap {
  std::shared_ptr<const ContourMap> map;
  MapParts parts;  ///< none: `map` is all of it
};

/// A map file with pages is read by place, any other as a whole. Errors: those of the readers; the map has
/// nothing around the start.
Expected<OpenedMap> open_map(const std::string& path, const Eigen::Vector3d& start_map,
                             const TrackerConfig& config);

}  // namespace evpose
