// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/prepared_scene.h"

namespace evpose::sim {

PreparedScene::PreparedScene(const Scene& of, ThreadPool& pool)
    : scene(of), rays(of), channels(light_channels(of)) {
  std::int32_t first = 0;
  still = segment_surfaces(of.mesh, first);
  for (const MovingPart& part : of.moving) moving.push_back(segment_surfaces(part.mesh, first));
  bake_lights(rays, channels, still, pool);
}

}  // namespace evpose::sim
