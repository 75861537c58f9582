// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/panes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace evpose::sim {

PlateLight plate_light(double cosine, double index) {
  const double inside = std::sqrt(1 - (1 - cosine * cosine) / (index * index));  // Snell's law
  const double across = (cosine - index * inside) / (cosine + index * inside),
               along = (index * cosine - inside) / (index * cosine + inside);
  PlateLight out{0, 0};
  for (const double amplitude : {across, along}) {
    const double face = amplitude * amplitude;
    out.mirrored += 0.5 * 2 * face / (1 + face);
    out.through += 0.5 * (1 - face) / (1 + face);
  }
  return out;
}

std::optional<PaneView> make_pane_view(const Pane& pane, const Pose& T_map_cam) {
  constexpr double kInPlane_m = 1e-7;
  const Eigen::Vector3d n = pane.u.cross(pane.v).normalized();
  const Eigen::Matrix3d R_cam_map = T_map_cam.rotation().transpose();
  PaneView out;
  out.pane = &pane;
  out.mirror = {n, -n.dot(pane.corner), (R_cam_map * n).cast<float>(), 0};
  const double reach = n.dot(pane.corner - T_map_cam.p);
  if (std::abs(reach) < kInPlane_m) return std::nullopt;
  out.mirror.reach = static_cast<float>(reach);
  // Fraction of the way along u at a point: that of the camera, plus a linear function of the way from there.
  const Eigen::Vector3d nearness = R_cam_map * n / reach;
  const auto fraction = [&](const Eigen::Vector3d& side, const Eigen::Vector3d& other) -> Eigen::Vector3d {
    const Eigen::Vector3d gradient = other.cross(n) / side.dot(other.cross(n));
    return gradient.dot(T_map_cam.p - pane.corner) * nearness + R_cam_map * gradient;
  };
  const Eigen::Vector3d by_u = fraction(pane.u, pane.v), by_v = fraction(pane.v, pane.u);
  out.nearness = nearness.cast<float>();
  out.side = {by_u.cast<float>(), (nearness - by_u).cast<float>(), by_v.cast<float>(),
              (nearness - by_v).cast<float>()};
  return out;
}

double largest_nearness(const PaneView& pane, std::span<const Eigen::Vector3d> directions) {
  const auto at = [](const Eigen::Vector3f& function, const Eigen::Vector3d& direction) {
    return function.cast<double>().dot(direction);
  };
  for (const Eigen::Vector3f& side : pane.side)
    if (std::all_of(directions.begin(), directions.end(),
                    [&](const Eigen::Vector3d& d) { return at(side, d) < 0; }))
      return 0;
  double largest = 0;
  for (const Eigen::Vector3d& d : directions) largest = std::max(largest, at(pane.nearness, d));
  return largest;
}

double distance(const Pane& pane, const Eigen::Vector3d& point) {
  const Eigen::Vector3d way = point - pane.corner;
  const double u = std::clamp(way.dot(pane.u) / pane.u.squaredNorm(), 0.0, 1.0),
               v = std::clamp(way.dot(pane.v) / pane.v.squaredNorm(), 0.0, 1.0);
  return (way - u * pane.u - v * pane.v).norm();
}

}  // namespace evpose::sim
