// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/held_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

// Concentrations from which on events make the pose better known: a little, and all of them.
constexpr double kNone = 0.6, kAll = 0.8;
constexpr double kRelease_s = 0.1;  // what was held fades so, with all of them

/// The smallest of the covariances with the principal axes that both have in common that is not below either.
Matrix6d join(const Matrix6d& held, const Matrix6d& now) {
  const Eigen::LLT<Matrix6d> factor(now);
  if (factor.info() != Eigen::Success) return now;
  const Matrix6d half = factor.matrixL().solve(held);
  const Matrix6d ratio = factor.matrixL().solve(half.transpose());
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(ratio);
  const Matrix6d larger =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(1).asDiagonal() * eigen.eigenvectors().transpose();
  const Matrix6d out = factor.matrixL() * larger * factor.matrixL().transpose();
  return 0.5 * (out + out.transpose());
}

}  // namespace

void HeldCovariance::restart(double position_m, double rotation_rad) {
  held_.reset();
  first_.diagonal().head<3>().setConstant(position_m * position_m);
  first_.diagonal().tail<3>().setConstant(rotation_rad * rotation_rad);
}

Matrix6d HeldCovariance::update(const Matrix6d& covariance, const Eigen::Quaterniond& q_map_body,
                                double concentration, double span_s) {
  Matrix6d turn = Matrix6d::Identity();
  turn.bottomRightCorner<3, 3>() = q_map_body.toRotationMatrix();
  const Matrix6d now = turn * covariance * turn.transpose();
  if (held_) {
    const double believed = std::clamp((concentration - kNone) / (kAll - kNone), 0.0, 1.0);
    const double kept = std::exp(-believed * span_s / kRelease_s);
    held_ = join(kept * *held_ + (1 - kept) * now, now);
  } else {
    held_ = now + first_;
  }
  return turn.transpose() * *held_ * turn;
}

}  // namespace evpose
