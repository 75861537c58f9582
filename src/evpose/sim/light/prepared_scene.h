// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/sim/light/lighting.h"
#include "evpose/sim/light/ray_caster.h"
#include "evpose/sim/light/surfaces.h"

namespace evpose::sim {

/// A scene prepared for rendering: ray caster, patches, baked light.
struct PreparedScene {
  /// Keeps a reference to the scene. `light` of the patches of its still mesh, if it is known.
  PreparedScene(const Scene& of, ThreadPool& pool, std::vector<LightMap> light = {});

  const PartSurfaces& surfaces_of(int part) const { return part < 0 ? still : moving[part]; }
  const Mesh& mesh_of(int part) const { return part < 0 ? scene.mesh : scene.moving[part].mesh; }
  const Patch& patch_of(const RayHit& hit) const {
    const PartSurfaces& surfaces = surfaces_of(hit.part);
    return surfaces.patches[surfaces.patch_of[hit.triangle]];
  }

  const Scene& scene;
  RayCaster rays;
  LightChannels channels;
  PartSurfaces still;
  std::vector<PartSurfaces> moving;  ///< by number in Scene::moving
};

}  // namespace evpose::sim
