// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/map_build/surface_points.h"

namespace evpose::map_build {

/// Two parallel surfaces nearer to each other than the noise tells points apart, as a wall and its plinth,
/// grow into one plane, which lies in neither and leans. Means over cells of many points tell them apart:
/// what stands off the larger one in a connected part, by more than the noise of the means, becomes a plane
/// of its own. `label`: plane of each point, -1: none; changed. `planes`: their number; returns how many
/// there are afterwards. `least_points`: of a plane.
std::int32_t split_layered_planes(const SurfacePoints& surface, double least_points, std::int32_t planes,
                                  std::vector<std::int32_t>& label);

}  // namespace evpose::map_build
