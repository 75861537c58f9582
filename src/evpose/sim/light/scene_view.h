// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/sim/light/panes.h"
#include "evpose/sim/light/pixel_rays.h"
#include "evpose/sim/light/prepared_scene.h"
#include "evpose/sim/world/lanes.h"

namespace evpose::sim {

/// A prepared scene at one instant, seen from one pose.
struct SceneView {
  double t_s = 0;
  Pose T_map_cam;
  Eigen::Matrix3d R_map_cam;
  std::vector<float> light;      ///< factor of each light channel
  std::vector<Pose> T_part_cam;  ///< of each moving part
  std::vector<Pose> T_map_part;
  std::vector<PaneView> panes;
};
SceneView make_scene_view(const PreparedScene& prepared, double t_s, const Pose& T_map_cam);
/// Interpolates two views that are less than a pixel apart; fraction 0 is `a`.
SceneView interpolate_view(const SceneView& a, const SceneView& b, double fraction);

/// A patch in the camera frame of one view: along ray r = (x, y, 1) the depth is reach / (normal . r), and a
/// texture coordinate is its value at the camera plus depth * (axis . r).
struct PatchView {
  const Patch* patch = nullptr;
  int part = -1;
  Eigen::Vector3f normal, u_axis, v_axis, right, up;
  float reach = 0, u = 0, v = 0, right0 = 0, up0 = 0;
};
PatchView make_patch_view(const SceneView& view, const Patch& patch, int part);
/// From any frame at `origin` in the part's frame; R_part_frame may be a reflection.
PatchView make_patch_view(const Eigen::Vector3d& origin, const Eigen::Matrix3d& R_part_frame,
                          const Patch& patch, int part);

/// Directions (x, y, 1) and the areas around them, spanned by their change by column and row; of one pixel or
/// of eight.
template <class V>
struct RayAreas {
  V x, y, column_x, column_y, row_x, row_y;
};
/// Mean luminance over each area, cd/m^2, as seen through the panes before the patch. A clear coat and a pane
/// mirror what stands still, without panes and coats; whether a pane is met is decided in the middle of an
/// area.
template <class V>
V luminance(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
            const RayAreas<V>& areas);
/// The same where no surface is met.
template <class V>
V sky_luminance(const PreparedScene& prepared, const SceneView& view, const RayAreas<V>& areas);
/// Mean luminance over the area of the pixel of `ray`, around its point (x, y), cd/m^2.
float luminance(const PreparedScene& prepared, const SceneView& view, const PatchView& patch,
                const PixelRay& ray, float x = 0, float y = 0);

}  // namespace evpose::sim
