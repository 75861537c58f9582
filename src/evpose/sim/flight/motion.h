// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>

#include "evpose/core/pose.h"

namespace evpose::sim {

/// Gravity in the map frame, m/s^2.
inline Eigen::Vector3d gravity_map() { return {0, 0, -9.81}; }

/// Pose of the body and its derivatives at one instant.
struct BodyMotion {
  Pose T_map_body;
  Eigen::Vector3d velocity;              ///< of the body's origin, map frame, m/s
  Eigen::Vector3d acceleration;          ///< map frame, m/s^2
  Eigen::Vector3d rate;                  ///< body frame, rad/s
  Eigen::Vector3d angular_acceleration;  ///< body frame, rad/s^2
};

/// Pose and velocity of the camera at one instant.
struct CameraMotion {
  Pose T_map_cam;
  Eigen::Vector3d velocity;  ///< of the camera's centre, camera frame, m/s
  Eigen::Vector3d rate;      ///< camera frame, rad/s
};
using CameraPath = std::function<CameraMotion(double t_s)>;

}  // namespace evpose::sim
