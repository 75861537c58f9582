// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/map_build/fitted_plane.h"
#include "evpose/map_build/surface_points.h"

namespace evpose::map_build {

struct Planes {
  std::vector<FittedPlane> planes;
  std::vector<std::int32_t> label;  ///< plane of each point, -1: none
};

struct PlaneConfig {
  double angle_rad = 0.30;   ///< most between a point's normal and its plane
  double gate_sigma = 3;     ///< most distance of a point from its plane, in units of the noise
  double least_patches = 1;  ///< points of a plane, in patches that tell a normal
  /// Rms of a plane that has contours, in units of the typical plane's.
  double most_rough = 2;
  double most_tilt_rad = 0.02;  ///< error of the direction of a plane that has contours, 1 sigma
  double merge_rad = 0.026;     ///< planes that touch and agree to this angle and to the noise become one
};

/// Region growing on normals, from the flattest points on (EV-Pose, Map Construction): each region follows
/// the plane fitted to it so far, so that it cannot creep around a bend. Points in the bends, whose normals
/// belong to neither side, go to the nearest plane beside them afterwards, and have no part in the fits.
Planes find_planes(const SurfacePoints& surface, const PlaneConfig& config);

}  // namespace evpose::map_build
