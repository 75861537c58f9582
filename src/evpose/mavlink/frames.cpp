// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/mavlink/frames.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

/// The vehicle's origin and axes, in the map. Its error is (position in the map, rotation in its own axes).
struct Vehicle {
  Pose T_map_vehicle;
  Eigen::Vector3d velocity_map, rates_vehicle;
  Matrix6d covariance;
  Eigen::Matrix3d velocity_covariance_map;
};

Vehicle move_to_vehicle(const Update& u, const Pose& T_body_vehicle) {
  Vehicle out;
  out.T_map_vehicle = u.T_map_body * T_body_vehicle;
  const Eigen::Matrix3d R_map_body = u.T_map_body.rotation();
  const Eigen::Matrix3d R_vehicle_body = T_body_vehicle.rotation().transpose();
  const Eigen::Vector3d& lever = T_body_vehicle.p;
  out.velocity_map = u.velocity + R_map_body * u.angular_rate.cross(lever);
  out.rates_vehicle = R_vehicle_body * u.angular_rate;
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = -R_map_body * so3::hat(lever);
  J.bottomRightCorner<3, 3>() = R_vehicle_body;
  out.covariance = J * u.covariance * J.transpose();
  out.velocity_covariance_map = u.velocity_covariance;
  return out;
}

Matrix6d rotate_blocks(const Matrix6d& covariance, const Eigen::Matrix3d& R_position,
                       const Eigen::Matrix3d& R_rotation) {
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = R_position;
  J.bottomRightCorner<3, 3>() = R_rotation;
  return J * covariance * J.transpose();
}

}  // namespace

Eigen::Matrix3d rotation_frd_flu() { return Eigen::Vector3d(1, -1, -1).asDiagonal(); }

Pose ned_from_heading(double map_x_heading_rad) {
  const double c = std::cos(map_x_heading_rad), s = std::sin(map_x_heading_rad);
  Pose out;
  out.q = Eigen::Quaterniond((Eigen::Matrix3d() << c, s, 0, s, -c, 0, 0, 0, -1).finished());
  return out;
}

NedState to_ned(const Update& update, const VehicleFrames& frames) {
  const Vehicle v = move_to_vehicle(update, frames.T_body_vehicle);
  const Eigen::Matrix3d R_ned_map = frames.T_ned_map.rotation();
  const Eigen::Matrix3d R_frd_flu = rotation_frd_flu();
  const Eigen::Matrix3d R_ned_frd = R_ned_map * v.T_map_vehicle.rotation() * R_frd_flu.transpose();
  NedState out;
  out.t = update.t;
  out.position = frames.T_ned_map * v.T_map_vehicle.p;
  out.q_ned_frd = Eigen::Quaterniond(R_ned_frd).normalized();
  out.velocity_ned = R_ned_map * v.velocity_map;
  out.velocity_frd = R_ned_frd.transpose() * out.velocity_ned;
  out.rates_frd = R_frd_flu * v.rates_vehicle;
  out.covariance = rotate_blocks(v.covariance, R_ned_map, R_frd_flu);
  out.velocity_covariance_ned = R_ned_map * v.velocity_covariance_map * R_ned_map.transpose();
  out.velocity_covariance_frd = R_ned_frd.transpose() * out.velocity_covariance_ned * R_ned_frd;
  return out;
}

RosState to_ros(const Update& update, const Pose& T_body_vehicle) {
  const Vehicle v = move_to_vehicle(update, T_body_vehicle);
  const Eigen::Matrix3d R = v.T_map_vehicle.rotation();
  RosState out;
  out.T_map_base = v.T_map_vehicle;
  out.velocity_base = R.transpose() * v.velocity_map;
  out.rates_base = v.rates_vehicle;
  out.covariance = rotate_blocks(v.covariance, Eigen::Matrix3d::Identity(), R);
  out.velocity_covariance_base = R.transpose() * v.velocity_covariance_map * R;
  return out;
}

Eigen::Vector3d euler_of(const Eigen::Quaterniond& q_ned_frd) {
  const Eigen::Matrix3d R = q_ned_frd.toRotationMatrix();
  return {std::atan2(R(2, 1), R(2, 2)), -std::asin(std::clamp(R(2, 0), -1.0, 1.0)),
          std::atan2(R(1, 0), R(0, 0))};
}

}  // namespace evpose
