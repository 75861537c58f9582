// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/landmark_view.h"

#include <Eigen/LU>

namespace evpose {
namespace {

/// Its pixel now depends on the numbers, and so does where its pixel of then puts it. `by_point`: as the row
/// depends on the latter.
Eigen::VectorXd by_numbers(const LandmarkView& view, const Eigen::Vector3d& now,
                           const Eigen::RowVector3d& by_point, const Eigen::Vector2d& normal_px,
                           const AdjustedCamera& camera) {
  const auto pixel_now = camera.by_numbers(now), pixel_then = camera.by_numbers(view.point_then);
  Matrix23d by_point_then;
  if (!pixel_now || !pixel_then || !camera.given().project(view.point_then, &by_point_then))
    return Eigen::VectorXd::Zero(camera.numbers());
  const Eigen::MatrixXd moved = -by_point_then.leftCols<2>().inverse() * *pixel_then;
  return (by_point.head<2>() * moved - normal_px.transpose() * *pixel_now).transpose();
}

}  // namespace

Eigen::Vector3d LandmarkView::point_now() const {
  return (T_map_body * T_body_cam).inverse() * (T_map_kept * (T_kept_then * (T_body_cam * point_then)));
}

RelativeInformation::Vector landmark_row(const LandmarkView& view, const Vector6d& by_pose,
                                         const Eigen::Vector2d& normal_px, const AdjustedCamera* adjusted) {
  const Eigen::Matrix3d R_now = view.T_map_body.rotation(), R_kept = view.T_map_kept.rotation();
  const Eigen::Matrix3d R_map_then = R_kept * view.T_kept_then.rotation(), R_cam = view.T_body_cam.rotation();
  // The camera moves in the map, or the point against it.
  const Eigen::RowVector3d by_point = -by_pose.head<3>().transpose();
  const Eigen::Vector3d in_kept = view.T_kept_then * (view.T_body_cam * view.point_then);
  const Eigen::Vector3d now = view.point_now();
  RelativeInformation::Vector row(RelativeInformation::kNumbers);
  row << by_pose, by_point.transpose(), -(by_point * R_kept * so3::hat(in_kept)).transpose(),
      (by_point * (R_now * so3::hat(R_cam * now) - R_map_then * so3::hat(R_cam * view.point_then)))
          .transpose();
  if (adjusted == nullptr) return row;
  row.conservativeResize(RelativeInformation::kNumbers + adjusted->numbers());
  row.tail(adjusted->numbers()) = by_numbers(view, now, by_point * R_map_then * R_cam, normal_px, *adjusted);
  return row;
}

}  // namespace evpose
