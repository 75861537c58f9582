// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/sim/world/world_draft.h"

namespace evpose::sim {

/// Materials out of doors.
struct OutdoorMaterials {
  std::vector<std::int32_t> walls, grounds;
  std::int32_t frame = 0, ledge = 0, glass = 0, door = 0, pole = 0, concrete = 0, container = 0, lamp = 0;
};
/// `texel_m` of the walls and grounds.
OutdoorMaterials add_outdoor_materials(WorldDraft& draft, double texel_m);

struct Facade {
  double width = 10, height = 8;  // metres
  double bay = 2.5, storey = 3.2;
  double window_width = 1.1, window_height = 1.5, sill = 0.95;
  double balconies = 0;  ///< share of the windows above the ground floor that have one
  std::int32_t wall = 0;
};
/// A facade that looks to -y of the place, with its lower edge's middle there: windows with panes, bars and
/// sills, doors, ledges between the storeys, a cornice.
void put_facade(WorldDraft& draft, const OutdoorMaterials& m, const Place& place, const Facade& facade);

/// A lamp post; shines at night so that there are `lux` below it. The arm goes to -y.
void put_lamp_post(WorldDraft& draft, const OutdoorMaterials& m, const Place& place, double height_m,
                   double arm_m);

}  // namespace evpose::sim
