// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/scene.h"

#include <limits>

namespace evpose::sim {

std::optional<SceneHit> Scene::trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  BoxHit nearest{std::numeric_limits<double>::max(), -1};
  std::size_t hit = 0;
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    const Pose T_box_map = boxes[b].T_map_box.inverse();
    const BoxHit at = hit_box(T_box_map * origin, T_box_map.q * direction, boxes[b].half, nearest.distance);
    if (at.side >= 0) nearest = at, hit = b;
  }
  if (nearest.side < 0) return std::nullopt;
  return SceneHit{nearest.distance, face_of(hit, nearest.side), origin + nearest.distance * direction};
}

bool Scene::solid(const Eigen::Vector3d& point) const {
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    const Eigen::Vector3d p = boxes[b].T_map_box.inverse() * point;
    const bool inside = (p.cwiseAbs().array() < boxes[b].half.array()).all();
    if (inside != (b == 0)) return true;
  }
  return false;
}

Eigen::Vector3d Scene::normal(Face face) const {
  const BoxSide side = face % 6;
  const double out = face < 6 ? -sign_of(side) : sign_of(side);
  return boxes[face / 6].T_map_box.q * (out * Eigen::Vector3d::Unit(axis_of(side)));
}

}  // namespace evpose::sim
