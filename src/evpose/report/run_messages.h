// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/report/run_files.h"

namespace evpose {

struct RunMessages {
  std::size_t poses = 0, pictures = 0, map_points = 0;
  std::string without;  ///< why there are no pictures or no map; empty: both are there
};

/// A run as an MCAP file of ROS 2 messages, for Foxglove: /tf and /pose (with covariance about the map's
/// axes) at each update that the tracker stands by, /health at each update, /trajectory and /map once,
/// /overlay ten times a second. Errors: stamps that ROS cannot carry; writing, or reading events, fails.
Expected<RunMessages> write_run_mcap(const std::string& path, const RunFiles& run);

}  // namespace evpose
