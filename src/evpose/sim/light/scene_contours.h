// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/map/contour_map.h"
#include "evpose/sim/light/ray_caster.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// The true contours of the static mesh: edges where the surface that is visible from the space between
/// Scene::low and high bends by more than 10 degrees (crease; also where bodies touch) or ends (boundary).
/// Excluded are seams within a plane, prints, the facets of smooth bodies, and edges that are buried or
/// hidden from everywhere. Points about every `spacing_m`; the whole mesh as occluders. The same for any
/// number of threads.
ContourMap make_contours(const Scene& scene, const RayCaster& rays, double spacing_m, ThreadPool& pool);

}  // namespace evpose::sim
