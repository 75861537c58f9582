// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/map/contour_map.h"
#include "evpose/map/contour_segments.h"

namespace evpose {

/// A visible contour sample and its motion over the events' span.
struct ContourSample {
  Eigen::Vector2d pixel;        ///< at the time of the update, predicted
  Eigen::Vector2d normal_px;    ///< unit, across the contour
  int normal_side = 1;          ///< +1 if `normal_px` points as the image of the map's normal does, else -1
  double speed_px_s = 0;        ///< s1: normal . velocity of the contour in the image
  double curvature_px_s2 = 0;   ///< s2: normal . (u(t - a) - u(t)) = -s1 a + s2 a^2 for age a
  Vector6d jacobian;            ///< derivative of an event's signed distance by the pose perturbation
  double map_sigma_px = 0;      ///< the map's error across the contour, in the image
  double speed_sigma_px_s = 0;  ///< error of the speed, 1 sigma
  std::uint32_t segment = 0;    ///< contrast segment of the contour
  std::uint32_t point = 0;      ///< of the map
  double flow_px_s = 0;         ///< velocity in the image, in any direction
  double depth_m = 0;           ///< distance from the camera
};

/// What the contours are seen with.
struct ContourView {
  const ContourMap& map;
  const ContourSegments& segments;
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
