// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/map/contour_map.h"
#include "evpose/map/contour_segments.h"
#include "evpose/registration/event_alignment.h"

namespace evpose {

/// What the contours are seen with.
struct ContourView {
  const ContourMap& map;
  const ContourSegments& pieces;
  const Camera& camera;
  const Pose& T_body_cam;
  double map_sigma_m;  ///< of points that state none
};

/// A pose and how it changes.
struct BodyMotion {
  Pose T_map_body;
  Eigen::Vector3d velocity;      ///< map frame, m/s
  Eigen::Vector3d angular_rate;  ///< body frame, rad/s
};

/// Projects points of the map at this pose and at those half a span and a span ago (design.md 5.2); points
/// that the camera does not see then are left out. Replaces `samples`.
void project_contours(const ContourView& view, std::span<const std::uint32_t> points,
                      const BodyMotion& motion, double span_s, std::vector<ContourSample>& samples);

}  // namespace evpose
