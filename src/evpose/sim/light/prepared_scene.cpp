// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/prepared_scene.h"

namespace evpose::sim {

PreparedScene::PreparedScene(const Scene& of, ThreadPool& pool, std::vector<LightMap> light)
    : scene(of), rays(of), channels(light_channels(of)) {
  std::int32_t first = 0;
  still = segment_surfaces(of.mesh, first);
  for (const MovingPart& part : of.moving) moving.push_back(segment_surfaces(part.mesh, first));
  if (light.size() == still.patches.size())
    for (std::size_t k = 0; k < light.size(); ++k) still.patches[k].light = std::move(light[k]);
  else
    bake_lights(rays, channels, still, pool);
}

}  // namespace evpose::sim
