// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/ekf.h"

#include <Eigen/LU>

namespace evpose {
namespace {

void symmetrise(Matrix15d& m) { m = (0.5 * (m + m.transpose())).eval(); }

}  // namespace

void correct(FusionState& state, const PoseInformation& m) {
  // Kalman update in a form that needs no inverse of the (possibly singular) information H:
  //   dx = P_x (I + H P)^-1 b,   P' = P - P_x (I + H P)^-1 H P_x^T,  P_x the first six columns of P.
  const Matrix6d P = state.pose_covariance();
  const Eigen::Matrix<double, 15, 6> P_x = state.covariance.leftCols<6>();
  const Eigen::PartialPivLU<Matrix6d> lu(Matrix6d::Identity() + m.information * P);
  const Vector15d dx = P_x * lu.solve(m.vector);
  state.covariance -= (P_x * lu.solve(m.information) * P_x.transpose()).eval();
  symmetrise(state.covariance);
  state.add(dx);
  // The attitude error now refers to the corrected body axes.
  Matrix15d G = Matrix15d::Identity();
  G.block<3, 3>(error_state::kPhi, error_state::kPhi) = so3::right_jacobian(dx.segment<3>(error_state::kPhi));
  state.covariance = (G * state.covariance * G.transpose()).eval();
  symmetrise(state.covariance);
}

}  // namespace evpose
