// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/sim/light/ray_caster.h"
#include "evpose/sim/light/surfaces.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// Lights that are switched alike share a channel; channel 0 is constant.
struct LightChannels {
  std::vector<LightSwitching> switching;  ///< of each channel
  std::vector<int> of_light;              ///< channel of each light of the scene

  std::vector<float> factors(double t_s) const;
  double step_s(double t_s) const;         ///< the shortest of LightSwitching::step_s
  double next_switch_s(double t_s) const;  ///< the first of LightSwitching::next_switch_s
};
LightChannels light_channels(const Scene& scene);

/// Light on what stands still: half shadows of lamps and sun, and how much of the surroundings a place sees
/// (nearby things keep the light from all sides out of corners). Fills the light maps of the patches.
void bake_lights(const RayCaster& rays, const LightChannels& channels, PartSurfaces& surfaces,
                 ThreadPool& pool);

/// Illuminance at a place in the map frame, lux by channel, nothing in the way: for moving things.
void open_light(const Scene& scene, const LightChannels& channels, const Eigen::Vector3d& point,
                const Eigen::Vector3d& normal, float* by_channel);

}  // namespace evpose::sim
