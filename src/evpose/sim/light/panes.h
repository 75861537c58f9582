// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "evpose/core/pose.h"
#include "evpose/sim/world/lanes.h"
#include "evpose/sim/world/scene.h"

namespace evpose::sim {

/// Fractions of unpolarised light that a clear plane plate in air mirrors and lets through.
struct PlateLight {
  double mirrored = 0, through = 1;
};
/// By Fresnel's equations at both faces, with all reflections between them and without interference: a
/// reflectance r of one face makes 2 r / (1 + r) of the plate, for each polarisation. `cosine` of the angle
/// of incidence, 0 to 1; `index` of refraction, above 1.
PlateLight plate_light(double cosine, double index);

inline constexpr double kGlassIndex = 1.5;

/// A plane that mirrors, in the map and in the camera frame of one view: along ray r = (x, y, 1) its depth is
/// reach / (in_camera . r).
struct MirrorPlane {
  Eigen::Vector3d normal;  ///< unit, map frame: normal . p + offset = 0
  double offset = 0;
  Eigen::Vector3f in_camera;  ///< the normal
  float reach = 0;
};

/// A pane as seen from a camera. `nearness` (1 / m) and the sides are linear functions of a direction
/// (x, y, 1): the pane is met where none of them is negative.
struct PaneView {
  const Pane* pane = nullptr;
  MirrorPlane mirror;
  Eigen::Vector3f nearness;
  std::array<Eigen::Vector3f, 4> side;
};
/// None where the camera is in the plane of the pane. Keeps a reference to the pane.
std::optional<PaneView> make_pane_view(const Pane& pane, const Pose& T_map_cam);

/// A linear function of the direction (x, y, 1); of one direction or of eight.
template <class V>
V along(const Eigen::Vector3f& function, const V& x, const V& y) {
  return function.x() * x + function.y() * y + function.z();
}

/// Where the direction meets the pane, nearer than the nearness `beyond`, 1 / m.
template <class V>
typename LaneTypes<V>::Mask meets(const PaneView& pane, const V& x, const V& y, const V& beyond) {
  typename LaneTypes<V>::Mask in = along(pane.nearness, x, y) > beyond;
  for (const Eigen::Vector3f& side : pane.side) in = in & (along(side, x, y) >= 0.0F);
  return in;
}

/// Bound on the nearness of the pane within the hull of directions (x, y, 1), 1 / m; 0: it is not met there.
double largest_nearness(const PaneView& pane, std::span<const Eigen::Vector3d> directions);

/// Distance of a point from a pane of right angles, metres; map frame.
double distance(const Pane& pane, const Eigen::Vector3d& point);

}  // namespace evpose::sim
