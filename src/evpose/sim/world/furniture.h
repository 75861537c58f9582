// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/sim/world/world_draft.h"

namespace evpose::sim {

/// Materials that furniture is made of.
struct FurnitureMaterials {
  std::vector<std::int32_t> woods, cartons, spines, cloths, posters;
  std::int32_t metal = 0, paper = 0, screen = 0, dark = 0, white = 0;
};
inline constexpr double kSpineRow_m = 0.3;  ///< a row of the spines' texture
FurnitureMaterials add_furniture_materials(WorldDraft& draft, double texel_m);

struct Dimensions {
  double width, depth, height;  // metres
};

// Each is one object. Backs at y = 0 where they have one; sizes in metres.
void put_bookshelf(WorldDraft& draft, const FurnitureMaterials& m, const Place& place,
                   const Dimensions& size);
void put_cupboard(WorldDraft& draft, const FurnitureMaterials& m, const Place& place, const Dimensions& size);
/// A table around the place, with things on it.
void put_table(WorldDraft& draft, const FurnitureMaterials& m, const Place& place, const Dimensions& size);
void put_chair(WorldDraft& draft, const FurnitureMaterials& m, const Place& place);
/// Cartons on each other, up to a height.
void put_cartons(WorldDraft& draft, const FurnitureMaterials& m, const Place& place, double width,
                 double highest);
/// A picture in a frame that hangs on the wall, its middle `z` high.
void put_picture(WorldDraft& draft, const FurnitureMaterials& m, const Place& place, double z, double width,
                 double height);
/// Paper stuck to the wall, lower left corner at (x, z).
void put_poster(WorldDraft& draft, const FurnitureMaterials& m, const Place& place, double x, double z);
void put_bench(WorldDraft& draft, const FurnitureMaterials& m, const Place& place, double width);

/// Size of the sheet that a poster's texture was made for.
Repeat poster_size(std::size_t number);

}  // namespace evpose::sim
