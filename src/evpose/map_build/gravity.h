// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "evpose/core/pose.h"
#include "evpose/map/contour_map.h"

namespace evpose::map_build {

/// Where up is, as floors, ceilings and walls say.
struct UpDirection {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< map frame, unit
  double tilt_rad = 0;                            ///< between it and the map's z
  double level_share = 0, upright_share = 0;      ///< of the planes' points: on floors and ceilings, on walls
  bool known = false;                             ///< there is a floor, or walls of two directions
};

/// The direction that floors and ceilings are most square to and walls most parallel with, each plane with
/// the weight of its points. Only planes within 15 degrees of level or upright take part, so z must be
/// roughly up.
UpDirection find_up(const ContourMap& map);

/// The map turned about its anchor so that `up` becomes z, by the smallest rotation.
void level(ContourMap& map, const Eigen::Vector3d& up);

}  // namespace evpose::map_build
