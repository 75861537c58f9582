// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/worlds.h"

#include <utility>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/world/world_builder.h"

namespace evpose::sim {

void describe(ConfigTable& table, WorldConfig& c) {
  const ConfigTable::Choices<WorldKind> kinds = {
      {"hall", WorldKind::hall}, {"courtyard", WorldKind::courtyard}, {"canyon", WorldKind::canyon}};
  table.add("kind", c.kind, kinds,
            "hall (room of 8 x 6 x 3 m), courtyard (with a landing platform) or canyon (street)");
  table.add("seed", c.seed, "", "selects arrangement, textures and tones", {0, 1e9});
  table.add("texture_contrast", c.texture_contrast, "", "factor on the contrasts of all textures", {0, 3});
  table.add("lamp_lux", c.lamp_lux, "lux",
            "hall: at table height; outside at night: 20 times that below a street lamp", {0, 1e5});
  table.add("window_cd_m2", c.window_cd_m2, "cd/m^2", "hall: the sky seen through the window", {0, 1e5});
  table.add("sun_lux", c.sun_lux, "lux", "outside: sun, on a surface facing it", {0, 2e5});
  table.add("sun_azimuth_deg", c.sun_azimuth_deg, "deg", "azimuth of the sun, from +x to +y", {-360, 360});
  table.add("sun_elevation_deg", c.sun_elevation_deg, "deg", "elevation of the sun", {1, 90});
  table.add("sky_lux", c.sky_lux, "lux", "outside: sky, on open ground", {0, 1e5});
  table.add("night", c.night, "no sun, hardly a sky; street lamps are on");
  table.add("repeated_facades", c.repeated_facades, "outside: facades whose windows are all alike");
  table.add(
      "mirror", c.mirror, "",
      "reflectance of the hall's floor, outside of window panes, at normal incidence; 0: matt, glass: 0.04",
      {0, 1});
  table.add("glass_wall", c.glass_wall,
            "hall: a framed glass wall before the tables, and a pane in the window");
  table.add("pad_mark", c.pad_mark, pad_marks(), "courtyard: on the landing platform");
  table.group("movers", c.movers);
}

Status build_world(WorldBuilder& builder) {
  if (builder.config.kind == WorldKind::hall && builder.config.movers.cars > 0)
    return Error{"movers.cars", "the hall has no room for cars",
                 "take the courtyard or the canyon, or 0 cars"};
  if (builder.config.glass_wall && builder.config.kind != WorldKind::hall)
    return Error{"glass_wall", "only the hall has a glass wall", "take the hall, or glass_wall: false"};
  if (builder.config.glass_wall && builder.config.movers.people > 0)
    return Error{"movers.people", "the glass wall stands where people walk",
                 "take 0 people, or no glass wall"};
  builder.random = Random(static_cast<std::uint64_t>(builder.config.seed), 0x576F726C64);
  switch (builder.config.kind) {
    case WorldKind::hall:
      build_hall(builder);
      break;
    case WorldKind::courtyard:
      build_courtyard(builder);
      break;
    case WorldKind::canyon:
      build_canyon(builder);
      break;
  }
  return {};
}

Expected<Scene> make_world(const WorldConfig& config, ThreadPool& pool) {
  WorldBuilder builder(config);
  if (auto status = build_world(builder); !status) return status.error();
  builder.scene.materials = builder.materials.build(config.texture_contrast, pool);
  return std::move(builder.scene);
}

}  // namespace evpose::sim
