// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/core/geodesy.h"
#include "evpose/core/pose.h"
#include "evpose/tracker/update.h"

namespace evpose {

// The one place where the estimate leaves its own frames (design.md 2: map z up; body = IMU).

/// Forward-right-down from forward-left-up, and back.
Eigen::Matrix3d rotation_frd_flu();
/// T_ned_map of a level map whose x axis has this compass heading (90: east, so that the map is ENU).
Pose ned_from_heading(double map_x_heading_rad);

/// Where the vehicle is fixed to the body, and how the map lies in the world.
struct VehicleFrames {
  Pose T_ned_map;       ///< local north-east-down from the map
  Pose T_body_vehicle;  ///< vehicle: forward-left-up, at its own origin; identity: the IMU is the vehicle
};

/// The vehicle as an autopilot wants it.
struct NedState {
  TimeNs t = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< of the vehicle's origin, NED, m
  Eigen::Quaterniond q_ned_frd = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity_ned = Eigen::Vector3d::Zero();  ///< of the vehicle's origin, m/s
  Eigen::Vector3d velocity_frd = Eigen::Vector3d::Zero();  ///< the same in the vehicle's axes
  Eigen::Vector3d rates_frd = Eigen::Vector3d::Zero();     ///< rad/s
  /// (position in NED, rotation about the vehicle's forward, right and down axes): near level flight these
  /// are errors of roll, pitch and yaw.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Matrix3d velocity_covariance_ned = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_covariance_frd = Eigen::Matrix3d::Zero();
};
NedState to_ned(const Update& update, const VehicleFrames& frames);

/// The vehicle as ROS wants it (REP 103, 105): map -> base_link, forward-left-up.
struct RosState {
  Pose T_map_base;
  Eigen::Vector3d velocity_base = Eigen::Vector3d::Zero();  ///< in base_link, m/s
  Eigen::Vector3d rates_base = Eigen::Vector3d::Zero();     ///< in base_link, rad/s
  Matrix6d covariance = Matrix6d::Zero();  ///< (position, rotation about the map's fixed axes)
  Eigen::Matrix3d velocity_covariance_base = Eigen::Matrix3d::Zero();
};
RosState to_ros(const Update& update, const Pose& T_body_vehicle);

/// Roll, pitch, yaw of R_ned_frd: R = Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Vector3d euler_of(const Eigen::Quaterniond& q_ned_frd);

}  // namespace evpose
