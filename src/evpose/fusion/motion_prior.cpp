// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/motion_prior.h"

namespace evpose {

using namespace error_state;

MotionPrior::Residual MotionPrior::residual(const FusionState& i, const FusionState& j) const {
  const double dt = to_seconds(j.t - i.t);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Eigen::Quaterniond &q_i = i.nav.T_map_body.q, &q_j = j.nav.T_map_body.q;
  const Eigen::Quaterniond kept = so3::exp(dt * i.angular_rate);
  const Eigen::Vector3d turned = so3::log(kept.conjugate() * q_i.conjugate() * q_j);
  Residual r;
  r.value << j.nav.T_map_body.p - i.nav.T_map_body.p - dt * i.nav.velocity, turned,
      j.nav.velocity - i.nav.velocity;
  r.by_start.setZero();
  r.by_end.setZero();
  r.by_start.block<3, 3>(kP, kP) = -I;
  r.by_start.block<3, 3>(kP, kV) = -dt * I;
  r.by_start.block<3, 3>(kV, kV) = -I;
  r.by_end.block<3, 3>(kP, kP) = I;
  r.by_end.block<3, 3>(kV, kV) = I;
  const Eigen::Matrix3d by_end = so3::right_jacobian_inverse(turned);
  r.by_end.block<3, 3>(kPhi, kPhi) = by_end;
  r.by_start.block<3, 3>(kPhi, kPhi) = -by_end * (q_j.conjugate() * q_i).toRotationMatrix();
  // The rate is the gyroscope's reading less its bias.
  r.by_start.block<3, 3>(kPhi, kBg) =
      dt * so3::right_jacobian_inverse(-turned) * so3::right_jacobian(dt * i.angular_rate);
  return r;
}

MotionPrior::Matrix9d MotionPrior::covariance(double dt) const {
  const double qa = accel_density_ * accel_density_, qw = angular_density_ * angular_density_;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  Matrix9d Q = Matrix9d::Zero();
  Q.block<3, 3>(kP, kP) = qa * dt * dt * dt / 3 * I;
  Q.block<3, 3>(kP, kV) = Q.block<3, 3>(kV, kP) = 0.5 * qa * dt * dt * I;
  Q.block<3, 3>(kV, kV) = qa * dt * I;
  Q.block<3, 3>(kPhi, kPhi) = qw * dt * dt * dt / 3 * I;
  return Q;
}

}  // namespace evpose
