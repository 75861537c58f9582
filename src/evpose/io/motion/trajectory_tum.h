// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"

namespace evpose {

/// Rows `t tx ty tz qx qy qz qw`, seconds and metres, `#` comments. Stamps are read as decimal text to the
/// exact nanosecond (further digits are cut off). Errors name the line: not eight numbers, not finite, stamps
/// that repeat or go back, a quaternion whose norm is off 1 by more than 1e-2 (a smaller error is normalised
/// away), no pose.
Expected<std::vector<TimedPose>> read_tum(const std::string& path);

/// Nine decimals for time (exact) and position, ten for the quaternion, whose sign runs on without jumps.
/// `comment` becomes the first line, after "# ", unless empty.
Status write_tum(const std::string& path, const std::vector<TimedPose>& trajectory,
                 const std::string& comment = "");

}  // namespace evpose
