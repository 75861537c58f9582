// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/sim/flight/motion.h"

namespace evpose::sim {

/// Attitude with angular rate and angular acceleration, both in the body frame.
struct AngularMotion {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();                  ///< rad/s
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  ///< rad/s^2

  /// Appends a rotation by `angle` about `axis`, which is fixed in the body; `angle_1` and `angle_2` are the
  /// first two time derivatives of the angle.
  void rotate(const Eigen::Vector3d& axis, double angle, double angle_1, double angle_2);
};

/// Poses over time with four continuous derivatives: a uniform quintic B-spline of positions, and its
/// cumulative form for rotations (T. Sommer et al., CVPR 2020), whose rate and angular acceleration are
/// exact.
class PoseSpline {
 public:
  /// `control`[k] belongs to time first_s + k * knot_s; at least one. Before the first and after the last the
  /// ends are held, so that the curve comes to rest there within kReach knots.
  PoseSpline(double knot_s, std::vector<Pose> control, double first_s = 0);
  static constexpr int kReach = 3;

  /// Least squares through poses at increasing times from 0 on. Gaps are bridged smoothly.
  static PoseSpline fit(const std::vector<double>& t_s, const std::vector<Pose>& poses, double knot_s);

  BodyMotion at(double t_s) const;
  /// Time of the last control pose.
  double duration_s() const { return first_s_ + knot_s_ * static_cast<double>(control_.size() - 1); }

 private:
  void set_steps();
  std::size_t index(std::ptrdiff_t k) const;

  double knot_s_, first_s_;
  std::vector<Pose> control_;
  std::vector<Eigen::Vector3d> steps_;  ///< [k]: rotation vector from control k - 1 to k, the first zero
};

}  // namespace evpose::sim
