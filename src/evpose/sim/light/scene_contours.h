// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/map/contour_map.h"
#include "evpose/sim/light/ray_caster.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// The true contours of what stands still: where the surface around it, as it can be seen from the space
/// between Scene::low and high, bends by more than 10 degrees (crease; also where things stand on or against
/// each other) or ends (boundary). Left out are seams within a plane, what is printed, the facets of smooth
/// bodies and what is buried or hidden from everywhere. Points every `spacing_m`, about; the whole mesh as
/// occluders. The same for any number of threads.
ContourMap make_contours(const Scene& scene, const RayCaster& rays, double spacing_m, ThreadPool& pool);

}  // namespace evpose::sim
