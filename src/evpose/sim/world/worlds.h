// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "evpose/core/error.h"
#include "evpose/sim/world/movers.h"
#include "evpose/sim/world/printed_things.h"
#include "evpose/sim/world/scene.h"

namespace evpose {
class ConfigTable;
class ThreadPool;
}  // namespace evpose

namespace evpose::sim {

enum class WorldKind : std::uint8_t {
  hall,       ///< a room of 8 x 6 x 3 m, one corner at the origin
  courtyard,  ///< 24 x 20 m around a landing platform, whose top is at z = 0.3
  canyon,     ///< a street of 100 m along x between facades
};

struct WorldConfig {
  WorldKind kind = WorldKind::hall;
  int seed = 1;                 ///< arrangement, textures and tones
  double texture_contrast = 1;  ///< factor on the contrasts of all textures
  double lamp_lux =
      400;  ///< hall: in its middle at table height; outside at night: 20 times that below a street lamp
  double window_cd_m2 = 2500;    ///< hall: the sky outside
  double sun_lux = 60000;        ///< outside, facing it
  double sun_azimuth_deg = 215;  ///< from +x to +y
  double sun_elevation_deg = 48;
  double sky_lux = 15000;            ///< outside, on open ground
  bool night = false;                ///< no sun, hardly a sky, street lamps on
  bool repeated_facades = false;     ///< outside: facades whose windows are all alike
  PadMark pad_mark = PadMark::none;  ///< courtyard: on the landing platform
  bool glass_wall = false;           ///< hall: a glass wall before the tables, a pane in the window
  double mirror = 0;                 ///< Material::mirror of the floor in the hall, of window panes outside
  MoversConfig movers;
};
void describe(ConfigTable& table, WorldConfig& config);

/// The world with its moving objects. The same for any number of threads. Scene::low and high bound the free
/// space: over the whole height for hall and canyon, above a cone of 45 degrees from the rim of the pad in
/// the courtyard. Errors: moving objects for which the world has no room.
Expected<Scene> make_world(const WorldConfig& config, ThreadPool& pool);

}  // namespace evpose::sim
