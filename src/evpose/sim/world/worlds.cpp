// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/worlds.h"

#include <utility>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/world/world_draft.h"

namespace evpose::sim {

void describe(ConfigTable& table, WorldConfig& c) {
  const ConfigTable::Choices<WorldKind> kinds = {
      {"hall", WorldKind::hall}, {"courtyard", WorldKind::courtyard}, {"canyon", WorldKind::canyon}};
  table.add("kind", c.kind, kinds,
            "hall (room of 8 x 6 x 3 m), courtyard (with a landing platform) or canyon (street)");
  table.add("seed", c.seed, "", "picks arrangement, textures and tones", {0, 1e9});
  table.add("texture_contrast", c.texture_contrast, "", "factor on the contrasts of all textures", {0, 3});
  table.add("lamp_lux", c.lamp_lux, "lux", "hall: at table height; outside: under a street lamp at night",
            {0, 1e5});
  table.add("window_cd_m2", c.window_cd_m2, "cd/m^2", "hall: the sky seen through the window", {0, 1e5});
  table.add("sun_lux", c.sun_lux, "lux", "outside: sun, on a surface that faces it", {0, 2e5});
  table.add("sun_azimuth_deg", c.sun_azimuth_deg, "deg", "where the sun stands, from +x to +y", {-360, 360});
  table.add("sun_elevation_deg", c.sun_elevation_deg, "deg", "height of the sun", {1, 90});
  table.add("sky_lux", c.sky_lux, "lux", "outside: sky, on open ground", {0, 1e5});
  table.add("night", c.night, "no sun, hardly a sky; street lamps are on");
  table.group("movers", c.movers);
}

Status lay_out_world(WorldDraft& draft) {
  if (draft.config.kind == WorldKind::hall && draft.config.movers.cars > 0)
    return Error{"movers.cars", "the hall has no room for cars",
                 "take the courtyard or the canyon, or 0 cars"};
  draft.random = Random(static_cast<std::uint64_t>(draft.config.seed), 0x576F726C64);
  switch (draft.config.kind) {
    case WorldKind::hall:
      lay_out_hall(draft);
      break;
    case WorldKind::courtyard:
      lay_out_courtyard(draft);
      break;
    case WorldKind::canyon:
      lay_out_canyon(draft);
      break;
  }
  return {};
}

Expected<Scene> make_world(const WorldConfig& config, ThreadPool& pool) {
  WorldDraft draft(config);
  if (auto status = lay_out_world(draft); !status) return status.error();
  draft.scene.materials = draft.materials.take(config.texture_contrast, pool);
  return std::move(draft.scene);
}

}  // namespace evpose::sim
