// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/sim/light/pixel_rays.h"
#include "evpose/sim/light/stage.h"

namespace evpose::sim {

/// A stage at one instant, seen from one place.
struct View {
  double t_s = 0;
  Pose T_map_cam;
  Eigen::Matrix3d R_map_cam;
  std::vector<float> light;      ///< factor of each channel
  std::vector<Pose> T_part_cam;  ///< of each moving part
  std::vector<Pose> T_map_part;
};
View make_view(const Stage& stage, double t_s, const Pose& T_map_cam);
/// Between two views that are less than a pixel apart; share 0 is `a`.
View between(const View& a, const View& b, double share);

/// A patch as one view's pixels see it: with ray r = (x, y, 1), depth is reach / (normal . r) and a
/// coordinate is start + depth * (axis . r).
struct PatchView {
  const Patch* patch = nullptr;
  int part = -1;
  Eigen::Vector3f normal, u_axis, v_axis, right, up;
  float reach = 0, u = 0, v = 0, right0 = 0, up0 = 0;
};
PatchView view_patch(const View& view, const Patch& patch, int part);

/// Mean luminance over the pixel that `ray` belongs to, around the point (x, y) of it, cd/m^2.
float luminance(const Stage& stage, const View& view, const PatchView& patch, const PixelRay& ray,
                float x = 0, float y = 0);

}  // namespace evpose::sim
