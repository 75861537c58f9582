// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <numbers>
#include <vector>

#include "evpose/sim/scene.h"

namespace evpose::sim {

/// A plainly coloured box of a test.
struct PlainBox {
  Eigen::Vector3d middle, size;
  double yaw_deg, reflectance;
};

/// A cube of 6 m around the origin, of reflectance 0.2, with boxes in it; lit evenly, so that radiance is
/// reflectance.
inline Scene test_scene(const std::vector<PlainBox>& boxes) {
  std::vector<PlainBox> all = {{{0, 0, 0}, {6, 6, 6}, 0, 0.2}};
  all.insert(all.end(), boxes.begin(), boxes.end());
  Scene scene;
  for (const PlainBox& plain : all) {
    Box box{{so3::exp(plain.yaw_deg * std::numbers::pi / 180 * Eigen::Vector3d::UnitZ()), plain.middle},
            0.5 * plain.size,
            {}};
    for (BoxSide side = 0; side < 6; ++side)
      box.faces.emplace_back(plain.size[texture_u_axis(side)], plain.size[texture_v_axis(side)], 0.5,
                             [&](double, double) { return plain.reflectance; });
    scene.boxes.push_back(std::move(box));
  }
  scene.lamp_power = 0;
  scene.ambient = 1;
  return scene;
}

}  // namespace evpose::sim
