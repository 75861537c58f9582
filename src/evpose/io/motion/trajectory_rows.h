// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"

namespace evpose {

/// How a row of text holds a stamp, a position and a quaternion.
struct PoseRowLayout {
  std::string row;               ///< in words, for errors
  std::string unit = "seconds";  ///< of stamps
  int time_decimals = 9;         ///< from that unit to nanoseconds
  bool w_first = false;
  std::size_t most_columns = 8;  ///< what follows the pose is ignored
};

/// Rows between `#` comments. Errors name the line: too few or many values, not finite, stamps that repeat or
/// go back, a quaternion whose norm is off 1 by more than 1e-2 (a smaller error is normalised away), no pose.
Expected<std::vector<TimedPose>> read_pose_rows(const std::string& path, const PoseRowLayout& layout);

/// The error of a stamp that does not come after the last one, given in seconds.
Error not_after(const std::string& where, TimeNs t, TimeNs last);

}  // namespace evpose
