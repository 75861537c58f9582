// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/tracker_start.h"

#include <algorithm>

namespace evpose {

Expected<std::unique_ptr<Tracker>> make_tracker(const TrackerSetup& setup, const TrackerConfig& config,
                                                const TrackerStart& start, const StageClock& clock) {
  TrackerConfig own_config = config;
  FusionConfig& fusion = own_config.fusion;
  fusion.start_position_sigma_m = std::max(fusion.start_position_sigma_m, start.position_sigma_m);
  fusion.start_rotation_sigma_rad = std::max(fusion.start_rotation_sigma_rad, start.rotation_sigma_rad);
  fusion.start_velocity_sigma_m_s = std::max(fusion.start_velocity_sigma_m_s, start.velocity_sigma_m_s);
  own_config.relocalization.on = start.searches;
  const Eigen::Vector3d& place = start.state.T_map_body.p;
  TrackerSetup own = setup;
  if (setup.map_parts && (place - setup.map_middle).head<2>().norm() > MapPager::kPrepare_m)
    if (auto part = setup.map_parts(place, part_radius_m(config)); part && !part->points.empty()) {
      own.map = std::move(part);
      own.map_middle = place;
    }
  return Tracker::create(own, own_config, start.state, clock);
}

}  // namespace evpose
