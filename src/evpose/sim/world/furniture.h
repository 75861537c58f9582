// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/sim/world/world_builder.h"

namespace evpose::sim {

/// Materials that furniture is made of.
struct FurnitureMaterials {
  std::vector<std::int32_t> woods, cartons, spines, cloths, posters;
  std::int32_t metal = 0, paper = 0, screen = 0, dark = 0, white = 0;
};
inline constexpr double kSpineRow_m = 0.3;  ///< a row of the spines' texture
FurnitureMaterials add_furniture_materials(WorldBuilder& builder, double texel_m);

struct Dimensions {
  double width, depth, height;  // metres
};

// Each is one object. Backs at y = 0 where they have one; sizes in metres.
void put_bookshelf(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place,
                   const Dimensions& size);
void put_cupboard(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place,
                  const Dimensions& size);
/// A table centred on the placement, with objects on it.
void put_table(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place,
               const Dimensions& size);
void put_chair(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place);
/// Cartons on each other, up to a height.
void put_cartons(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double width,
                 double highest);
/// A picture in a frame that hangs on the wall, its middle `z` high.
void put_picture(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double z,
                 double width, double height);
/// Paper stuck to the wall, lower left corner at (x, z).
void put_poster(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double x,
                double z);
void put_bench(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double width);

/// Size of the sheet that a poster's texture was made for.
Repeat poster_size(std::size_t number);

}  // namespace evpose::sim
