// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contour_view.h"

#include <cstddef>

namespace evpose {
namespace {

constexpr std::size_t kAhead = 8;

/// Brings what is read of a point near: the map is larger than the caches.
void fetch(const ContourView& view, std::uint32_t point) {
  const char* at = reinterpret_cast<const char*>(&view.map.points[point]);
  __builtin_prefetch(at);
  __builtin_prefetch(at + offsetof(ContourPoint, sigma));
  __builtin_prefetch(&view.segments.of_point[point]);
}

}  // namespace

void project_contours(const ContourView& view, std::span<const std::uint32_t> points,
                      const BodyMotion& motion, double span_s, std::vector<ContourSample>& samples) {
  const Pose then{motion.T_map_body.q * so3::exp(-span_s * motion.angular_rate),
                  motion.T_map_body.p - span_s * motion.velocity};
  const Pose T_cam_map = (motion.T_map_body * view.T_body_cam).inverse(),
             then_T_cam_map = (then * view.T_body_cam).inverse();
  const Eigen::Matrix3d R = T_cam_map.rotation(), then_R = then_T_cam_map.rotation();
  // Of the map's anchor, camera frame.
  const Eigen::Vector3d offset = T_cam_map * view.map.anchor, then_offset = then_T_cam_map * view.map.anchor;
  const Eigen::Matrix3d R_body_map = motion.T_map_body.rotation().transpose();
  const Eigen::Matrix3d R_body_cam = view.T_body_cam.rotation(), R_cam_body = R_body_cam.transpose();
  const Eigen::Vector3d velocity_body = R_body_map * motion.velocity;
  samples.clear();
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (k + kAhead < points.size()) fetch(view, points[k + kAhead]);
    const std::uint32_t i = points[k];
    const ContourPoint& point = view.map.points[i];
    const Eigen::Vector3d position = point.position.cast<double>();
    const Eigen::Vector3d x_cam = R * position + offset;
    Matrix23d J;
    const auto pixel = view.camera.project(x_cam, &J);
    const auto ago = view.camera.project(then_R * position + then_offset);
    if (!pixel || !ago) continue;
    const Eigen::Vector2d along = J * (R * point.tangent.cast<double>());
    if (!(along.norm() > 0)) continue;
    const Eigen::Vector2d normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
    const Eigen::RowVector3d across = normal.transpose() * J;
    const Eigen::RowVector3d A = across * R_cam_body;
    const Eigen::Vector3d x_body = R_body_cam * x_cam + view.T_body_cam.p;
    // The body moves, the point stands.
    const Eigen::Vector2d flow = J * (R_cam_body * -(velocity_body + motion.angular_rate.cross(x_body)));
    ContourSample s;
    s.pixel = *pixel;
    s.normal_px = normal;
    s.normal_side = across.dot(R * point.normal.cast<double>()) < 0 ? -1 : 1;
    s.speed_px_s = normal.dot(flow);
    // n.(u(t - a) - u(t)) = -s1 a + s2 a^2, through the projection of then.
    if (span_s > 0)
      s.curvature_px_s2 = (normal.dot(*ago - *pixel) + s.speed_px_s * span_s) / (span_s * span_s);
    s.jacobian.head<3>() = (A * R_body_map).transpose();
    s.jacobian.tail<3>() = x_body.cross(A.transpose());
    s.map_sigma_px = (point.sigma > 0 ? point.sigma : view.map_sigma_m) * across.norm();
    s.segment = view.segments.of_point[i];
    s.point = i;
    s.flow_px_s = flow.norm();
    s.depth_m = x_cam.norm();
    samples.push_back(s);
  }
}

}  // namespace evpose
