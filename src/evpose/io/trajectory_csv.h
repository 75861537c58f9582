// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"

namespace evpose {

/// Ground truth as EuRoC writes it: rows `timestamp_ns, px, py, pz, qw, qx, qy, qz`, further columns ignored,
/// `#` comments. Errors name the line, as those of read_tum().
Expected<std::vector<TimedPose>> read_trajectory_csv(const std::string& path);

}  // namespace evpose
