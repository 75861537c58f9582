// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/sim/world/world_builder.h"

namespace evpose::sim {

/// Materials out of doors.
struct OutdoorMaterials {
  std::vector<std::int32_t> walls, grounds;
  std::int32_t frame = 0, ledge = 0, glass = 0, door = 0, pole = 0, concrete = 0, container = 0, lamp = 0;
};
/// `texel_m` of the walls and grounds.
OutdoorMaterials add_outdoor_materials(WorldBuilder& builder, double texel_m);

struct Facade {
  double width = 10, height = 8;  // metres
  double bay = 2.5, storey = 3.2;
  double window_width = 1.1, window_height = 1.5, sill = 0.95;
  double balconies = 0;  ///< fraction of the windows above the ground floor that have one
  std::int32_t wall = 0;
  bool repeats = false;  ///< all windows alike, none bricked up, the door on the left
};
/// A facade that faces -y of the placement, which is the middle of its lower edge: windows with panes, bars
/// and sills, doors, ledges between the storeys, a cornice.
void put_facade(WorldBuilder& builder, const OutdoorMaterials& m, const Placement& place,
                const Facade& facade);

/// A lamp post whose arm points to -y. At night it illuminates the ground below with a twentieth of
/// WorldConfig::lamp_lux.
void put_lamp_post(WorldBuilder& builder, const OutdoorMaterials& m, const Placement& place, double height_m,
                   double arm_m);

}  // namespace evpose::sim
