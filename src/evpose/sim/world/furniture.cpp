// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/furniture.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

constexpr unsigned kNoFloor = all_sides & ~static_cast<unsigned>(side_below);
constexpr double kBoard = 0.022;  // thickness, metres
using V = Eigen::Vector3d;

std::int32_t any_of(WorldBuilder& builder, const std::vector<std::int32_t>& materials) {
  return materials[static_cast<std::size_t>(builder.pick(0, static_cast<int>(materials.size()) - 1))];
}

Finish wooden(WorldBuilder& builder, std::int32_t wood, std::int32_t object) {
  Finish finish = builder.finish(wood, object);
  finish.along_grain = true;
  return finish;
}

// Books side by side between two x, their backs at `front`, standing at `z`.
struct BookRow {
  double x0, x1, front, depth, z, highest;
};
void put_books(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, const BookRow& row,
               std::int32_t object) {
  for (double x = row.x0; x < row.x1 - 0.05;) {
    const double width = std::min(builder.random.uniform(0.06, 0.24), row.x1 - x);
    const double height = row.highest * builder.random.uniform(0.62, 0.94);
    const double set_back = builder.random.uniform(0, 0.05),
                 depth = row.depth * builder.random.uniform(0.7, 0.9);
    if (builder.chance(0.12)) {  // a gap, or an object
      if (builder.chance(0.5))
        put_box(builder, place, V(x + 0.01, row.front + 0.03, row.z),
                V(x + width, row.front + 0.15, row.z + 0.6 * height),
                builder.finish(any_of(builder, m.cartons), object), kNoFloor);
      x += width + 0.01;
      continue;
    }
    const double front = row.front + set_back;
    put_box(builder, place, V(x, front, row.z), V(x + width, front + depth, row.z + height),
            builder.finish(m.paper, object), kNoFloor & ~static_cast<unsigned>(side_south));
    Finish spines = builder.finish(any_of(builder, m.spines), object);
    spines.uv.y() = kSpineRow_m * std::floor(spines.uv.y() / kSpineRow_m) + 0.01;
    add_face(builder.scene.mesh,
             {place.T_map_object * V(x, front, row.z), place.T_map_object.q * V(width, 0, 0),
              place.T_map_object.q * V(0, 0, height)},
             spines);
    x += width + builder.random.uniform(0.0, 0.03) + 0.012;
  }
}

void put_monitor(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, const V& foot,
                 std::int32_t object) {
  const Placement here(place.T_map_object * Pose{so3::exp(V(0, 0, builder.random.uniform(-0.5, 0.5))), foot});
  put_box(builder, here, V(-0.12, -0.09, 0), V(0.12, 0.09, 0.018), builder.finish(m.dark, object), kNoFloor);
  put_box(builder, here, V(-0.025, 0.0, 0.018), V(0.025, 0.03, 0.2), builder.finish(m.metal, object),
          kNoFloor);
  put_box(builder, here, V(-0.27, -0.04, 0.12), V(0.27, 0.0, 0.46), builder.finish(m.dark, object));
  put_sheet(builder, here, {-0.25, -0.04, 0.14, 0.5, 0.3}, {m.screen, object, {0, 0}});
}

void put_book_pile(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, const V& foot,
                   std::int32_t object) {
  double z = foot.z();
  const int count = builder.pick(2, 5);
  for (int i = 0; i < count; ++i) {
    const double thick = builder.random.uniform(0.02, 0.05), half = builder.random.uniform(0.09, 0.14);
    const Placement here(place.T_map_object *
                         Pose{so3::exp(V(0, 0, builder.random.uniform(-0.6, 0.6))), {foot.x(), foot.y(), z}});
    put_box(
        builder, here, V(-half, -0.72 * half, 0), V(half, 0.72 * half, thick),
        builder.finish(builder.chance(0.5) ? any_of(builder, m.posters) : any_of(builder, m.cloths), object),
        kNoFloor);
    z += thick;
  }
}

}  // namespace

Repeat poster_size(std::size_t number) {
  constexpr std::array<Repeat, 4> kSizes = {Repeat{0.6, 0.84}, {0.5, 0.7}, {0.9, 0.64}, {0.42, 0.6}};
  return kSizes[number % kSizes.size()];
}

FurnitureMaterials add_furniture_materials(WorldBuilder& builder, double texel_m) {
  FurnitureMaterials m;
  MaterialLibrary& shelf = builder.materials;
  const auto tone = [&](double low, double high) { return builder.random.uniform(low, high); };
  const Repeat small{1.6, 1.6}, wide{2.4, 1.2};
  for (const double plank : {0.09, 0.14}) {
    const std::int32_t wood =
        shelf.add_textured("wood", tone(0.7, 1.0), wide, texel_m, planks(wide, plank, builder.seed()));
    m.woods.push_back(wood);
    m.woods.push_back(shelf.add_with_tone("dark wood", tone(0.3, 0.55), wood));
  }
  for (int i = 0; i < 2; ++i) {
    const std::int32_t carton_material =
        shelf.add_textured("carton", tone(0.7, 1.0), small, texel_m, carton(small, builder.seed()));
    m.cartons.push_back(carton_material);
    m.cartons.push_back(shelf.add_with_tone("painted carton", tone(0.4, 1.3), carton_material));
  }
  for (int i = 0; i < 2; ++i)
    m.spines.push_back(shelf.add_textured("books", 1, {2, 1.2}, texel_m,
                                          book_spines({2, 1.2}, kSpineRow_m, builder.seed())));
  const std::int32_t cloth_material =
      shelf.add_textured("cloth", tone(0.6, 1), small, texel_m, cloth(small, builder.seed()));
  m.cloths = {cloth_material, shelf.add_with_tone("dark cloth", 0.4, cloth_material),
              shelf.add_with_tone("bright cloth", 1.3, cloth_material)};
  for (std::size_t i = 0; i < 8; ++i)
    m.posters.push_back(shelf.add_textured("poster", 1, poster_size(i), std::min(texel_m, 0.0025),
                                           poster(poster_size(i), builder.seed())));
  m.metal = shelf.add_textured("metal", tone(0.5, 0.9), wide, texel_m, container_side(wide, builder.seed()));
  m.paper = shelf.add_textured("paper", 1.3, small, texel_m, plaster(small, builder.seed()));
  m.screen = shelf.add_textured("screen", 0.8, {0.5, 0.3}, 0.002, screen_text({0.5, 0.3}, builder.seed()));
  m.dark = shelf.add_with_tone("dark plastic", 0.22, m.paper);
  m.white = shelf.add_with_tone("white paint", 1.5, m.paper);
  return m;
}

void put_bookshelf(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place,
                   const Dimensions& size) {
  const std::int32_t object = builder.add_furniture("bookshelf"), wood = any_of(builder, m.woods);
  const double half = 0.5 * size.width, inner = half - kBoard, depth = size.depth, height = size.height;
  const auto board = [&] { return wooden(builder, wood, object); };
  put_box(builder, place, V(-half, -depth, 0), V(-inner, 0, height), board(), kNoFloor);
  put_box(builder, place, V(inner, -depth, 0), V(half, 0, height), board(), kNoFloor);
  put_box(builder, place, V(-inner, -0.012, 0), V(inner, 0, height - kBoard), board(),
          side_south | side_north);
  const int count = std::max(2, static_cast<int>(std::lround(height / 0.37)));
  const double step = (height - kBoard - 0.06) / count;
  for (int i = 0; i <= count; ++i) {
    const double z = 0.06 + i * step, back = i == count ? 0 : -0.012;
    put_box(builder, place, V(-inner, -depth + 0.01, z), V(inner, back, z + kBoard), board(),
            side_south | side_below | side_above | (i == count ? side_north : 0u));
    if (i == count) break;
    put_books(builder, m, place,
              {-inner + 0.02, inner - 0.02, -depth + 0.03, depth - 0.06, z + kBoard, step - kBoard}, object);
  }
  if (builder.chance(0.7))
    put_cartons(builder, m, Placement(place.T_map_object * Pose{{1, 0, 0, 0}, {0, -0.5 * depth, height}}),
                0.28, 0.26);
}

void put_cupboard(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place,
                  const Dimensions& size) {
  const std::int32_t object = builder.add_furniture("cupboard"), wood = any_of(builder, m.woods);
  const double half = 0.5 * size.width;
  put_box(builder, place, V(-half, -size.depth, 0.08), V(half, 0, size.height),
          wooden(builder, wood, object));
  put_box(builder, place, V(-half + 0.03, -size.depth + 0.05, 0), V(half - 0.03, 0, 0.08),
          builder.finish(m.dark, object), side_south | side_west | side_east);
  const int doors = size.width > 0.7 ? 2 : 1, rows = size.height > 1.5 ? 2 : 1;
  const double door = size.width / doors, leaf = (size.height - 0.1) / rows;
  const std::int32_t front = any_of(builder, m.woods);
  for (int i = 0; i < doors; ++i) {
    for (int j = 0; j < rows; ++j) {
      const double x = -half + i * door, z = 0.09 + j * leaf;
      put_box(builder, place, V(x + 0.012, -size.depth - 0.018, z + 0.012),
              V(x + door - 0.012, -size.depth, z + leaf - 0.012), wooden(builder, front, object),
              all_sides & ~static_cast<unsigned>(side_north));
      const double knob = i == 0 ? x + door - 0.07 : x + 0.04;
      put_box(builder, place, V(knob, -size.depth - 0.05, z + 0.4 * leaf),
              V(knob + 0.03, -size.depth - 0.018, z + 0.4 * leaf + 0.14), builder.finish(m.metal, object),
              all_sides & ~static_cast<unsigned>(side_north));
    }
  }
  if (builder.chance(0.8))
    put_cartons(builder, m,
                Placement(place.T_map_object * Pose{{1, 0, 0, 0}, {0, -0.5 * size.depth, size.height}}), 0.34,
                0.5);
}

void put_table(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place,
               const Dimensions& size) {
  const std::int32_t object = builder.add_furniture("table"), wood = any_of(builder, m.woods);
  const double x = 0.5 * size.width, y = 0.5 * size.depth, top = size.height, leg = 0.06;
  put_box(builder, place, V(-x, -y, top - 0.035), V(x, y, top), wooden(builder, wood, object));
  put_box(builder, place, V(-x + 0.05, -y + 0.05, top - 0.12), V(x - 0.05, y - 0.05, top - 0.035),
          wooden(builder, wood, object), all_sides & ~static_cast<unsigned>(side_above));
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const V corner(sx * (x - 0.04), sy * (y - 0.04), 0), inner = corner - V(sx * leg, sy * leg, 0);
      V low = corner.cwiseMin(inner), high = corner.cwiseMax(inner);
      high.z() = top - 0.035;
      put_box(builder, place, low, high, wooden(builder, wood, object),
              side_west | side_east | side_south | side_north);
    }
  }
  if (builder.chance(0.75))
    put_monitor(builder, m, place, V(builder.random.uniform(-0.2, 0.2) * size.width, 0.1, top), object);
  put_book_pile(builder, m, place, V(-x + 0.22, -y + 0.2, top), object);
  if (builder.chance(0.6)) put_book_pile(builder, m, place, V(x - 0.2, -y + 0.25, top), object);
  if (builder.chance(0.8))
    put_box(builder, place, V(x - 0.42, y - 0.3, top),
            V(x - 0.16, y - 0.08, top + builder.random.uniform(0.12, 0.28)),
            builder.finish(any_of(builder, m.cartons), object), kNoFloor);
  put_post(builder, place.T_map_object * V(-x + 0.14, y - 0.14, top),
           {0.045, builder.random.uniform(0.1, 0.24), 24}, builder.finish(m.metal, object));
}

void put_chair(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place) {
  const std::int32_t object = builder.add_furniture("chair"), wood = any_of(builder, m.woods);
  put_box(builder, place, V(-0.21, -0.21, 0.43), V(0.21, 0.21, 0.46),
          builder.finish(any_of(builder, m.cloths), object));
  for (const double x : {-0.2, 0.165})
    for (const double y : {-0.2, 0.165})
      put_box(builder, place, V(x, y, 0), V(x + 0.035, y + 0.035, 0.43), wooden(builder, wood, object),
              side_west | side_east | side_south | side_north);
  for (const double x : {-0.2, 0.165})
    put_box(builder, place, V(x, 0.18, 0.46), V(x + 0.035, 0.21, 0.88), wooden(builder, wood, object),
            kNoFloor);
  put_box(builder, place, V(-0.165, 0.184, 0.62), V(0.165, 0.206, 0.84),
          builder.finish(any_of(builder, m.cloths), object),
          all_sides & ~static_cast<unsigned>(side_west | side_east));
}

void put_cartons(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double width,
                 double highest) {
  const std::int32_t object = builder.add_furniture("cartons");
  double z = 0, w = width;
  while (w > 0.12) {
    const double height = w * builder.random.uniform(0.6, 1.0);
    if (z + height > highest) break;
    const Placement here(place.T_map_object *
                         Pose{so3::exp(V(0, 0, builder.random.uniform(-0.4, 0.4))), {0, 0, z}});
    const double depth = w * builder.random.uniform(0.7, 0.95);
    put_box(builder, here, V(-0.5 * w, -0.5 * depth, 0), V(0.5 * w, 0.5 * depth, height),
            builder.finish(any_of(builder, m.cartons), object), kNoFloor);
    z += height;
    w *= builder.random.uniform(0.55, 0.85);
    if (builder.chance(0.3)) break;
  }
}

void put_picture(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double z,
                 double width, double height) {
  const std::int32_t object = builder.add_object("picture"), wood = any_of(builder, m.woods);
  const double x = 0.5 * width, y = 0.5 * height, rim = 0.035;
  const unsigned on_wall = all_sides & ~static_cast<unsigned>(side_north);
  put_box(builder, place, V(-x, -0.03, z - y), V(x, 0, z - y + rim), wooden(builder, wood, object), on_wall);
  put_box(builder, place, V(-x, -0.03, z + y - rim), V(x, 0, z + y), wooden(builder, wood, object), on_wall);
  const unsigned upright = side_west | side_east | side_south;
  put_box(builder, place, V(-x, -0.03, z - y + rim), V(-x + rim, 0, z + y - rim),
          wooden(builder, wood, object), upright);
  put_box(builder, place, V(x - rim, -0.03, z - y + rim), V(x, 0, z + y - rim), wooden(builder, wood, object),
          upright);
  const int number = builder.pick(0, static_cast<int>(m.posters.size()) - 1);
  put_sheet(builder, place, {-x + rim, -0.012, z - y + rim, width - 2 * rim, height - 2 * rim},
            {m.posters[static_cast<std::size_t>(number)], object, {0, 0}});
}

void put_poster(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double x,
                double z) {
  const auto number = static_cast<std::size_t>(builder.pick(0, static_cast<int>(m.posters.size()) - 1));
  const Repeat size = poster_size(number);
  put_sheet(builder, place, {x, 0, z, size.width_m, size.height_m},
            {m.posters[number], builder.add_object("poster"), {0, 0}});
}

void put_bench(WorldBuilder& builder, const FurnitureMaterials& m, const Placement& place, double width) {
  const std::int32_t object = builder.add_furniture("bench"), wood = any_of(builder, m.woods);
  const double x = 0.5 * width;
  for (int i = 0; i < 3; ++i)
    put_box(builder, place, V(-x, -0.22 + 0.155 * i, 0.42), V(x, -0.09 + 0.155 * i, 0.46),
            wooden(builder, wood, object));
  for (int i = 0; i < 2; ++i)
    put_box(builder, place, V(-x, 0.22, 0.56 + 0.17 * i), V(x, 0.25, 0.69 + 0.17 * i),
            wooden(builder, wood, object));
  for (const double at : {-x + 0.2, x - 0.28}) {
    put_box(builder, place, V(at, -0.2, 0), V(at + 0.08, 0.25, 0.42), builder.finish(m.metal, object),
            kNoFloor);
    put_box(builder, place, V(at, 0.25, 0.2), V(at + 0.08, 0.28, 0.86), builder.finish(m.metal, object));
  }
}

}  // namespace evpose::sim
