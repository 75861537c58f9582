// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/state.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace evpose {

using namespace error_state;

void FusionState::add(const Vector15d& d) {
  nav.T_map_body = nav.T_map_body.plus(d.head<6>());
  nav.velocity += d.segment<3>(kV);
  gyro_bias += d.segment<3>(kBg);
  accel_bias += d.segment<3>(kBa);
  angular_rate -= d.segment<3>(kBg);
}

Vector15d FusionState::minus(const FusionState& other) const {
  Vector15d d;
  d << nav.T_map_body.minus(other.nav.T_map_body), nav.velocity - other.nav.velocity,
      gyro_bias - other.gyro_bias, accel_bias - other.accel_bias;
  return d;
}

PoseInformation moved(const PoseInformation& m, const Pose& measured_at, const Pose& to) {
  const Vector6d d = to.minus(measured_at);
  Matrix6d J = Matrix6d::Identity();
  J.block<3, 3>(3, 3) = so3::right_jacobian_inverse(d.tail<3>());
  return {J.transpose() * m.information * J, J.transpose() * (m.vector - m.information * d)};
}

Vector6d ContourOffset::by_pose(const Eigen::Matrix3d& R_map_body) const {
  Vector6d out;
  out.head<3>() = R_map_body * across_body;
  out.tail<3>() = point_body.cross(across_body);
  return out;
}

double innovation(const Matrix6d& pose_covariance, const PoseInformation& m) {
  // z = H^-1 b has covariance P + H^-1, so that NIS = z^T (P + H^-1)^-1 z = b^T (H + H P H)^-1 b on H's
  // range.
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(m.information);
  const double largest = eigen.eigenvalues().maxCoeff();
  if (!(largest > 0)) return 0;
  Matrix6d basis = Matrix6d::Zero();
  int rank = 0;
  for (int i = 0; i < 6; ++i)
    if (eigen.eigenvalues()(i) > 1e-12 * largest) basis.col(rank++) = eigen.eigenvectors().col(i);
  const Eigen::MatrixXd U = basis.leftCols(rank);
  const Matrix6d S = m.information + m.information * pose_covariance * m.information;
  const Eigen::VectorXd b = U.transpose() * m.vector;
  return b.dot((U.transpose() * S * U).ldlt().solve(b)) / rank;
}

}  // namespace evpose
