// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/contour_view.h"

namespace evpose {

void project_contours(const ContourView& view, std::span<const std::uint32_t> points,
                      const BodyMotion& motion, double span_s, std::vector<ContourSample>& samples) {
  Eigen::Matrix3d R[3];
  Eigen::Vector3d offset[3];  // of the map's anchor, camera frame
  for (int k = 0; k < 3; ++k) {
    const double age = 0.5 * k * span_s;
    const Pose past{motion.T_map_body.q * so3::exp(-age * motion.angular_rate),
                    motion.T_map_body.p - age * motion.velocity};
    const Pose T_cam_map = (past * view.T_body_cam).inverse();
    R[k] = T_cam_map.rotation();
    offset[k] = T_cam_map * view.map.anchor;
  }
  const Eigen::Matrix3d R_body_map = motion.T_map_body.rotation().transpose();
  const Eigen::Matrix3d R_body_cam = view.T_body_cam.rotation();
  const double h = 0.5 * span_s;
  samples.clear();
  for (const std::uint32_t i : points) {
    const ContourPoint& point = view.map.points[i];
    const Eigen::Vector3d position = point.position.cast<double>();
    const Eigen::Vector3d x_cam = R[0] * position + offset[0];
    Matrix23d J;
    const auto pixel = view.camera.project(x_cam, &J);
    const auto half_ago = view.camera.project(R[1] * position + offset[1]),
               ago = view.camera.project(R[2] * position + offset[2]);
    if (!pixel || !half_ago || !ago) continue;
    const Eigen::Vector2d along = J * (R[0] * point.tangent.cast<double>());
    if (!(along.norm() > 0)) continue;
    const Eigen::Vector2d normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
    // n.(u(t - a) - u(t)) = -s1 a + s2 a^2 through the two past projections.
    const double d1 = normal.dot(*half_ago - *pixel), d2 = normal.dot(*ago - *pixel);
    const Eigen::RowVector3d across = normal.transpose() * J;
    const Eigen::RowVector3d A = across * R_body_cam.transpose();
    const Eigen::Vector3d x_body = R_body_cam * x_cam + view.T_body_cam.p;
    ContourSample s;
    s.pixel = *pixel;
    s.normal_px = normal;
    s.speed_px_s = (d2 - 4 * d1) / (2 * h);
    s.curvature_px_s2 = (d2 - 2 * d1) / (2 * h * h);
    s.jacobian.head<3>() = (A * R_body_map).transpose();
    s.jacobian.tail<3>() = x_body.cross(A.transpose());
    s.map_sigma_px = (point.sigma > 0 ? point.sigma : view.map_sigma_m) * across.norm();
    s.piece = view.pieces.of_point[i];
    s.point = i;
    s.flow_px_s = (*half_ago - *pixel).norm() / h;
    s.depth_m = x_cam.norm();
    samples.push_back(s);
  }
}

}  // namespace evpose
