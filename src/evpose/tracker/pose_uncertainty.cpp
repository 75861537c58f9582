// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_uncertainty.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose {
namespace {

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues().maxCoeff()));
}

// d pixel / d error of the pose, of a point that the camera sees in a direction.
Eigen::Matrix<double, 2, 6> image_jacobian(const Pose& T_map_body, const PoseUncertainty::View& view,
                                           const Eigen::Vector3d& ray_cam) {
  const Eigen::Vector3d point_cam = view.depth_m * ray_cam, point_body = view.T_body_cam * point_cam;
  Matrix23d by_point;
  view.camera.project(point_cam, &by_point);
  const Matrix23d by_body_point = by_point * view.T_body_cam.q.toRotationMatrix().transpose();
  Eigen::Matrix<double, 2, 6> out;
  out << -by_body_point * T_map_body.q.toRotationMatrix().transpose(), by_body_point * so3::hat(point_body);
  return out;
}

}  // namespace

PoseUncertainty::PoseUncertainty(const FusionState& state, const View& view) : state_(state), view_(view) {
  const Matrix6d covariance = state.pose_covariance();
  separate_px_ =
      view.camera.focal_px() * std::max(largest_sigma(covariance.topLeftCorner<3, 3>()) / view.depth_m,
                                        largest_sigma(covariance.bottomRightCorner<3, 3>()));
}

double PoseUncertainty::image_px() const {
  const Matrix6d covariance = state_.pose_covariance();
  const ImageSize size = view_.camera.size();
  double sum = 0;
  int count = 0;
  for (const double x : {0.25, 0.5, 0.75}) {
    for (const double y : {0.25, 0.5, 0.75}) {
      const auto ray = view_.camera.unproject({x * (size.width - 1), y * (size.height - 1)});
      if (!ray) continue;
      const auto jacobian = image_jacobian(state_.nav.T_map_body, view_, *ray);
      const Eigen::Matrix2d of_pixel = jacobian * covariance * jacobian.transpose();
      sum += Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(of_pixel).eigenvalues().maxCoeff();
      ++count;
    }
  }
  return std::sqrt(std::max(0.0, sum / count));
}

std::string PoseUncertainty::weakest_direction() const {
  const Matrix6d covariance = state_.pose_covariance();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> position(covariance.topLeftCorner<3, 3>()),
      rotation(covariance.bottomRightCorner<3, 3>());
  const bool turns = rotation.eigenvalues()[2] * view_.depth_m * view_.depth_m > position.eigenvalues()[2];
  const Eigen::Vector3d axis = turns ? state_.nav.T_map_body.q * rotation.eigenvectors().col(2)
                                     : Eigen::Vector3d(position.eigenvectors().col(2));
  const auto digits = [](double v) { return std::round(100 * v) / 100 + 0.0; };
  return text(turns ? "rotation about (" : "position along (", digits(axis.x()), ", ", digits(axis.y()), ", ",
              digits(axis.z()), ") of the map");
}

}  // namespace evpose
