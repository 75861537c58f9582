// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "serve_live.h"

namespace evpose {

/// `ros`, or `ros://EVENTS,IMU` with the names of two topics.
bool is_ros_address(const std::string& source);

/// Becomes the ROS node with the map, calibration, start and settings of the request; comes back only with
/// what went wrong.
Error start_ros_node(const ServeRequest& request);

}  // namespace evpose
