// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/sim/light/ray_caster.h"
#include "evpose/sim/light/surfaces.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// Lights with the same switching have one channel; channel 0 is constant.
struct LightChannels {
  std::vector<LightSwitching> switching;  ///< of each channel
  std::vector<int> of_light;              ///< channel of each light of the scene

  std::vector<float> factors(double t_s) const;
  double step_s(double t_s) const;         ///< the shortest of LightSwitching::step_s
  double next_switch_s(double t_s) const;  ///< the first of LightSwitching::next_switch_s
};
LightChannels light_channels(const Scene& scene);

/// Illuminance of the static surfaces: penumbrae of lamps and sun, and ambient light with the occlusion by
/// near surfaces (corners are darker). Fills the light maps of the patches.
void bake_lights(const RayCaster& rays, const LightChannels& channels, PartSurfaces& surfaces,
                 ThreadPool& pool);

/// Illuminance at a point in the map frame without occlusion, lux by channel; for moving parts.
void unoccluded_light(const Scene& scene, const LightChannels& channels, const Eigen::Vector3d& point,
                      const Eigen::Vector3d& normal, float* by_channel);

}  // namespace evpose::sim
