// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/map/contour_map.h"
#include "evpose/sim/scene.h"

namespace evpose::sim {

/// The true contours of a scene: the creases of its surface, which are the boxes' edges and the lines where
/// boxes touch the room or each other. Edges buried in other boxes and seams within a plane are none, and
/// nothing printed is. A point each `spacing_m`, kind crease, plane_a and plane_b are faces of the scene, one
/// contour number for each run of a box's edge; the boxes' faces are the occluders. Anchor: the map frame's
/// origin.
ContourMap make_contours(const Scene& scene, double spacing_m);

}  // namespace evpose::sim
