// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_uncertainty.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose {

PoseUncertainty::PoseUncertainty(const FusionState& state, double focal_px, double depth_m)
    : state_(state), depth_m_(depth_m) {
  const Matrix6d covariance = state.pose_covariance();
  const auto largest = [](const Eigen::Matrix3d& m) {
    return std::sqrt(
        std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues().maxCoeff()));
  };
  sigma_px_ = focal_px * std::max(largest(covariance.topLeftCorner<3, 3>()) / depth_m,
                                  largest(covariance.bottomRightCorner<3, 3>()));
}

std::string PoseUncertainty::weakest_direction() const {
  const Matrix6d covariance = state_.pose_covariance();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> position(covariance.topLeftCorner<3, 3>()),
      rotation(covariance.bottomRightCorner<3, 3>());
  const bool turns = rotation.eigenvalues()[2] * depth_m_ * depth_m_ > position.eigenvalues()[2];
  const Eigen::Vector3d axis = turns ? state_.nav.T_map_body.q * rotation.eigenvectors().col(2)
                                     : Eigen::Vector3d(position.eigenvectors().col(2));
  const auto digits = [](double v) { return std::round(100 * v) / 100 + 0.0; };
  return text(turns ? "rotation about (" : "position along (", digits(axis.x()), ", ", digits(axis.y()), ", ",
              digits(axis.z()), ") of the map");
}

}  // namespace evpose
