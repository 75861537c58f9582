// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <optional>

#include "evpose/sim/light/prepared_scene.h"
#include "evpose/sim/light/scene_view.h"

namespace evpose::sim {

/// A triangle as seen from a camera. All members are linear functions of a direction (x, y, 1): the triangle
/// is met where the three sides are not negative, at the depth whose inverse is `nearness`. This holds behind
/// and beside the camera too, so that nothing needs to be clipped. Two triangles that share an edge have the
/// same side there with opposite signs: no direction slips between them.
struct TriangleShape {
  std::array<Eigen::Vector3f, 3> side;  ///< side i: the edge from corner i to the next
  Eigen::Vector3f nearness;             ///< 1 / m
};

/// None where the camera is in the plane of the triangle. `corners` in the camera frame, `normal` and `reach`
/// of its plane: normal . p = reach.
inline std::optional<TriangleShape> triangle_shape(const std::array<Eigen::Vector3d, 3>& corners,
                                                   const Eigen::Vector3d& normal, double reach,
                                                   std::array<Eigen::Vector3d, 3>* edges = nullptr) {
  constexpr double kInPlane_m = 1e-7;
  std::array<Eigen::Vector3d, 3> cross;
  for (int i = 0; i < 3; ++i) cross[i] = corners[i].cross(corners[(i + 1) % 3]);
  if (edges != nullptr) *edges = cross;
  const double volume = cross[0].dot(corners[2]);
  if (volume == 0 || std::abs(reach) < kInPlane_m) return std::nullopt;
  TriangleShape out;
  for (int i = 0; i < 3; ++i)
    out.side[i] = (volume < 0 ? Eigen::Vector3d(-cross[i]) : cross[i]).cast<float>();
  out.nearness = (normal / reach).cast<float>();
  return out;
}

}  // namespace evpose::sim
