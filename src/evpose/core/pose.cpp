// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/pose.h"

#include <cmath>

namespace evpose {
namespace so3 {

Eigen::Matrix3d hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

Eigen::Quaterniond exp(const Eigen::Vector3d& phi) {
  const double angle2 = phi.squaredNorm();
  const double angle = std::sqrt(angle2);
  // sin(angle/2)/angle and cos(angle/2); the series avoids 0/0 and is exact to rounding below 1e-4 rad.
  const double s = angle < 1e-4 ? 0.5 - angle2 / 48.0 : std::sin(0.5 * angle) / angle;
  Eigen::Quaterniond q(std::cos(0.5 * angle), s * phi.x(), s * phi.y(), s * phi.z());
  q.normalize();
  return q;
}

Eigen::Vector3d log(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q.vec();
  const double w = sign * q.w();
  const double n = v.norm();
  if (n < 1e-10) return 2.0 / w * v;
  return 2.0 * std::atan2(n, w) / n * v;
}

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi) {
  const double a2 = phi.squaredNorm();
  const double a = std::sqrt(a2);
  const Eigen::Matrix3d k = hat(phi);
  const double c1 = a < 1e-4 ? 0.5 - a2 / 24.0 : (1 - std::cos(a)) / a2;
  const double c2 = a < 1e-3 ? 1.0 / 6.0 - a2 / 120.0 : (a - std::sin(a)) / (a2 * a);
  return Eigen::Matrix3d::Identity() - c1 * k + c2 * k * k;
}

Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& phi) {
  const double a2 = phi.squaredNorm();
  const double a = std::sqrt(a2);
  const Eigen::Matrix3d k = hat(phi);
  const double c = a < 1e-3 ? 1.0 / 12.0 + a2 / 720.0 : 1.0 / a2 - 0.5 / (a * std::tan(0.5 * a));
  return Eigen::Matrix3d::Identity() + 0.5 * k + c * k * k;
}

}  // namespace so3

Pose Pose::operator*(const Pose& T_b_c) const {
  Pose out{q * T_b_c.q, q * T_b_c.p + p};
  out.q.normalize();
  return out;
}

Pose Pose::inverse() const {
  const Eigen::Quaterniond qi = q.conjugate();
  return {qi, -(qi * p)};
}

Eigen::Matrix4d Pose::matrix() const {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() = rotation();
  T.topRightCorner<3, 1>() = p;
  return T;
}

Pose Pose::from_matrix(const Eigen::Matrix4d& T) {
  Pose out{Eigen::Quaterniond(Eigen::Matrix3d(T.topLeftCorner<3, 3>())), T.topRightCorner<3, 1>()};
  out.q.normalize();
  return out;
}

Pose Pose::plus(const Vector6d& d) const {
  Pose out{q * so3::exp(d.tail<3>()), p + d.head<3>()};
  out.q.normalize();
  return out;
}

Vector6d Pose::minus(const Pose& other) const {
  Vector6d d;
  d << p - other.p, so3::log(other.q.conjugate() * q);
  return d;
}

Pose interpolate(const Pose& a, const Pose& b, double u) {
  return {a.q.slerp(u, b.q), (1 - u) * a.p + u * b.p};
}

}  // namespace evpose
