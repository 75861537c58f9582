// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "evpose/core/time.h"

namespace evpose {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// The rotation group with its exponential map; all functions are exact and smooth through zero.
namespace so3 {

/// Matrix of the cross product: hat(a) * b = a x b.
Eigen::Matrix3d hat(const Eigen::Vector3d& a);
/// Rotation by |phi| rad about phi.
Eigen::Quaterniond exp(const Eigen::Vector3d& phi);
/// Rotation vector with |phi| <= pi; the inverse of exp on that ball.
Eigen::Vector3d log(const Eigen::Quaterniond& q);
/// exp(phi + d) = exp(phi) * exp(right_jacobian(phi) * d) to first order in d.
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi);
Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& phi);

}  // namespace so3

/// Rigid transform T_a_b: takes coordinates in frame b to frame a, p_a = q * p_b + p.
struct Pose {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  ///< rotation R_a_b, unit
  Eigen::Vector3d p = Eigen::Vector3d::Zero();            ///< origin of b in a, metres

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_b) const { return q * point_b + p; }
  Pose operator*(const Pose& T_b_c) const;
  Pose inverse() const;
  Eigen::Matrix3d rotation() const { return q.toRotationMatrix(); }
  Eigen::Matrix4d matrix() const;
  static Pose from_matrix(const Eigen::Matrix4d& T);

  /// Perturbation of the whole project: d = (dp, dphi), p + dp in frame a, R * Exp(dphi) in frame b.
  /// 6x6 covariances are those of this d.
  Pose plus(const Vector6d& d) const;
  /// The d with other.plus(d) == *this.
  Vector6d minus(const Pose& other) const;
};

/// Linear in position, slerp in rotation; u = 0 gives a, u = 1 gives b.
Pose interpolate(const Pose& a, const Pose& b, double u);

/// A pose at a time; in trajectories T_map_body.
struct TimedPose {
  TimeNs t = 0;
  Pose pose;
};

}  // namespace evpose
