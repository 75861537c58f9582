// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/stage.h"

namespace evpose::sim {

Stage::Stage(const Scene& world, ThreadPool& pool)
    : scene(world), rays(world), channels(light_channels(world)) {
  std::int32_t first = 0;
  still = order_surfaces(world.mesh, first);
  for (const MovingPart& part : world.moving) moving.push_back(order_surfaces(part.mesh, first));
  bake_lights(rays, channels, still, pool);
}

}  // namespace evpose::sim
