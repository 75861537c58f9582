// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/part_extent.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace evpose::sim {
namespace {

struct CornerFlow {
  Eigen::AlignedBox2d extent;
  double speed_px_s = 0;
  int behind = 0;  // corners behind the camera or out of the domain of the lens model
};

// Image motion of the corners of a box that moves from pose `here` to pose `there` of the camera frame.
CornerFlow project_corners(const Eigen::AlignedBox3d& box, const Pose& here, const Pose& there,
                           const Camera& camera, double ahead_s) {
  CornerFlow out;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
    const Eigen::Vector3d p = here * corner, q = there * corner;
    if (p.z() < kNearest_m || q.z() < kNearest_m) {
      ++out.behind;
      continue;
    }
    const auto from = camera.project(p), to = camera.project(q);
    if (!from || !to) {
      ++out.behind;
      continue;
    }
    out.extent.extend(*from);
    out.extent.extend(*to);
    out.speed_px_s = std::max(out.speed_px_s, (*to - *from).norm() / ahead_s);
  }
  return out;
}

}  // namespace

PartExtent part_extent(const MovingPart& part, const Camera& camera, const CameraPath& path, TimeNs t,
                       double ahead_s) {
  PartExtent out;
  if (part.mesh.vertices.empty()) return out;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& v : part.mesh.vertices) box.extend(v.cast<double>());
  const auto T_cam_part = [&](double t_s) { return path(t_s).T_map_cam.inverse() * part.T_map_part(t_s); };
  const Pose here = T_cam_part(to_seconds(t)), there = T_cam_part(to_seconds(t) + ahead_s);
  const CornerFlow corners = project_corners(box, here, there, camera, ahead_s);
  if (corners.behind == 8) return out;
  const ImageSize size = camera.size();
  Eigen::AlignedBox2d extent = corners.extent;
  if (corners.behind > 0)
    extent = Eigen::AlignedBox2d(Eigen::Vector2d(0, 0), Eigen::Vector2d(size.width, size.height));
  // The flow of corners beside the camera grows without bound, yet they are not visible. The flow in the
  // image is bounded by the motion of the centre and the rotation, over the distance, at the corner of the
  // image.
  const double nearest = std::max(kNearest_m, std::sqrt(box.squaredExteriorDistance(here.inverse().p)));
  const double moved = (there * box.center() - here * box.center()).norm();
  const double turned = 0.5 * box.diagonal().norm() * here.q.angularDistance(there.q);
  const double f = camera.focal_px(), wide = 0.5 * std::hypot(size.width, size.height) / f;
  out.speed_px_s =
      std::min(corners.speed_px_s, f * (1 + wide * wide) * (moved + turned) / (nearest * ahead_s));
  out.box = {std::max(0, static_cast<int>(std::floor(extent.min().x())) - 2),
             std::max(0, static_cast<int>(std::floor(extent.min().y())) - 2),
             std::min(size.width, static_cast<int>(std::ceil(extent.max().x())) + 3),
             std::min(size.height, static_cast<int>(std::ceil(extent.max().y())) + 3)};
  out.visible = out.box.x0 < out.box.x1 && out.box.y0 < out.box.y1;
  return out;
}

std::vector<PartExtent> part_extents(const Scene& scene, const Camera& camera, const CameraPath& path,
                                     TimeNs t0, TimeNs t1) {
  constexpr int kSteps = 4;
  const double ahead_s = to_seconds(t1 - t0) / kSteps;
  std::vector<PartExtent> all;
  for (const MovingPart& part : scene.moving) {
    PartExtent sum;
    for (int k = 0; k < kSteps; ++k) {
      const PartExtent one = part_extent(part, camera, path, t0 + (t1 - t0) * k / kSteps, ahead_s);
      if (!one.visible) continue;
      sum.box = sum.visible ? PixelBox{std::min(sum.box.x0, one.box.x0), std::min(sum.box.y0, one.box.y0),
                                       std::max(sum.box.x1, one.box.x1), std::max(sum.box.y1, one.box.y1)}
                            : one.box;
      sum.visible = true;
      sum.speed_px_s = std::max(sum.speed_px_s, one.speed_px_s);
    }
    all.push_back(sum);
  }
  return all;
}

}  // namespace evpose::sim
