// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace evpose {

/// Points of surfaces as a LiDAR or depth camera gives them, map frame.
struct PointCloud {
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  ///< map frame, metres
  std::vector<Eigen::Vector3f> points;               ///< relative to the anchor, metres, finite
  std::vector<std::uint8_t> brightness;     ///< of each point, from reflectance or colour; empty: unknown
  std::vector<Eigen::Vector3d> viewpoints;  ///< that it was seen from, map frame; empty: unknown
  std::string source;                       ///< file it was read from, for messages
};

}  // namespace evpose
