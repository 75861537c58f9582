// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

struct Waypoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< map frame, metres
  double yaw_deg = 0;                                  ///< heading, from +x to the left
  double pause_s = 0;                                  ///< to stay there
};

/// Rows `x y z yaw_deg [pause_s]`, blanks or commas between, `#` comments. Errors name the line; fewer than
/// two points.
Expected<std::vector<Waypoint>> read_waypoints(const std::string& path);

}  // namespace evpose
