// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/sim/world/furniture.h"
#include "evpose/sim/world/world_builder.h"

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;
constexpr double kLength = 8, kWidth = 6, kHeight = 3;  // along x, y, z
constexpr double kTexel_m = 0.003;
constexpr double kGap = 0.02;  // between wall and furniture: the skirting's
constexpr unsigned kOnFloor = all_sides & ~static_cast<unsigned>(side_below);
constexpr unsigned kUpright = side_west | side_east | side_south | side_north;
constexpr double kQuarter = 0.5 * std::numbers::pi;

struct Hall {
  FurnitureMaterials furniture;
  std::int32_t walls[4] = {}, floor = 0, ceiling = 0, pillar = 0, carpet = 0, skirting = 0;
};

// The window lies in the far wall (x = 8), metres along y and z.
constexpr Opening kWindow{3.55, 5.15, 0.95, 2.25};

Hall add_materials(WorldBuilder& d) {
  Hall h;
  h.furniture = add_furniture_materials(d, kTexel_m);
  const Repeat wall{4, 3};
  const auto tone = [&](double low, double high) { return d.random.uniform(low, high); };
  const std::int32_t kinds[3] = {
      d.materials.add_textured("wallpaper", tone(0.85, 1.2), wall, kTexel_m, wallpaper(wall, d.seed())),
      d.materials.add_textured("bricks", tone(0.8, 1.2), wall, kTexel_m, bricks(wall, d.seed())),
      d.materials.add_textured("plaster", tone(0.9, 1.2), wall, kTexel_m, plaster(wall, d.seed()))};
  const int first = d.pick(0, 2);
  for (int i = 0; i < 4; ++i) h.walls[i] = kinds[(first + i) % 3];
  h.floor = d.chance(0.6) ? d.materials.add_textured("floor boards", tone(0.7, 1), wall, kTexel_m,
                                                     planks(wall, 0.16, d.seed()))
                          : d.materials.add_textured("floor tiles", tone(0.7, 1), wall, kTexel_m,
                                                     tiles(wall, 0.3, d.seed()));
  d.materials.set_mirror(h.floor, d.config.mirror);
  h.ceiling = d.materials.add_textured("ceiling", 1.2, {3, 3}, kTexel_m, ceiling_panels({3, 3}, d.seed()));
  h.pillar = d.materials.add_textured("marble", tone(0.9, 1.2), {2, 3}, kTexel_m, marble({2, 3}, d.seed()));
  h.carpet =
      d.materials.add_textured("carpet", tone(0.7, 1.1), {3, 2.4}, kTexel_m, carpet({3, 2.4}, d.seed()));
  h.skirting = d.materials.add_with_tone("skirting", 0.6, h.furniture.woods[0]);
  return h;
}

void add_shell(WorldBuilder& d, const Hall& h) {
  Mesh& mesh = d.scene.mesh;
  const std::int32_t floor = d.add_object("floor"), ceiling = d.add_object("ceiling"),
                     walls = d.add_object("walls");
  add_face(mesh, {V(0, 0, 0), V(kLength, 0, 0), V(0, kWidth, 0)}, d.finish(h.floor, floor));
  add_face(mesh, {V(0, kWidth, kHeight), V(kLength, 0, 0), V(0, -kWidth, 0)}, d.finish(h.ceiling, ceiling));
  add_face(mesh, {V(0, 0, 0), V(0, kWidth, 0), V(0, 0, kHeight)}, d.finish(h.walls[0], walls));
  add_face(mesh, {V(kLength, 0, 0), V(-kLength, 0, 0), V(0, 0, kHeight)}, d.finish(h.walls[1], walls));
  add_face(mesh, {V(0, kWidth, 0), V(kLength, 0, 0), V(0, 0, kHeight)}, d.finish(h.walls[2], walls));
  // Seen from inside, u of the far wall runs to -y.
  const Opening window{kWidth - kWindow.u1, kWidth - kWindow.u0, kWindow.v0, kWindow.v1};
  add_wall(mesh, {V(kLength, kWidth, 0), V(0, -kWidth, 0), V(0, 0, kHeight)}, {window}, 0.22,
           d.finish(h.walls[3], walls), d.finish(h.furniture.white, walls));
  const std::int32_t skirting = d.add_object("skirting");
  const double thick = 0.018, high = 0.09;
  const auto strip = [&](const V& low, const V& top, unsigned sides) {
    add_box_between(mesh, low, top, d.finish(h.skirting, skirting), sides | side_above);
  };
  strip({thick, 0, 0}, {kLength - thick, thick, high}, side_north);
  strip({thick, kWidth - thick, 0}, {kLength - thick, kWidth, high}, side_south);
  strip({0, 0, 0}, {thick, kWidth, high}, side_east);
  strip({kLength - thick, 0, 0}, {kLength, kWidth, high}, side_west);
  for (const double x : {2.6, 5.6}) {  // beams
    const double at = x + d.random.uniform(-0.3, 0.3);
    add_box_between(mesh, V(at, 0, kHeight - 0.2), V(at + 0.25, kWidth, kHeight),
                    d.finish(h.furniture.woods[1], d.add_object("beam")), side_west | side_east | side_below);
  }
}

// Bars across the window, a sill, and what is seen through it: sky, a house, roofs.
void add_window(WorldBuilder& d, const Hall& h) {
  Mesh& mesh = d.scene.mesh;
  const std::int32_t frame = d.add_object("window"), outside = d.add_object("outside");
  const Finish bars = d.finish(h.furniture.white, frame);
  const double x0 = kLength + 0.1, x1 = kLength + 0.15, middle = 0.5 * (kWindow.u0 + kWindow.u1),
               cross = kWindow.v1 - 0.4;
  add_box_between(mesh, V(x0, middle - 0.03, kWindow.v0), V(x1, middle + 0.03, kWindow.v1), bars, kUpright);
  const double ends[3][2] = {{kWindow.u0, middle - 0.03}, {middle + 0.03, kWindow.u1}, {}};
  for (int i = 0; i < 2; ++i)
    add_box_between(mesh, V(x0, ends[i][0], cross - 0.025), V(x1, ends[i][1], cross + 0.025), bars,
                    side_west | side_east | side_below | side_above);
  add_box_between(mesh, V(kLength - 0.16, kWindow.u0 - 0.1, kWindow.v0 - 0.05),
                  V(kLength, kWindow.u1 + 0.1, kWindow.v0 - 0.01), d.finish(h.furniture.white, frame),
                  all_sides & ~static_cast<unsigned>(side_east));
  const double sky = d.config.night ? 0.02 : d.config.window_cd_m2;
  const std::int32_t bright = d.materials.add_emissive("sky outside", sky, -1);
  const std::int32_t wall = d.materials.add_emissive("house outside", 0.4 * sky, -1);
  const std::int32_t pane = d.materials.add_emissive("panes outside", 0.12 * sky, -1);
  const std::int32_t roof = d.materials.add_emissive("roofs outside", 0.22 * sky, -1);
  const auto sheet = [&](double x, const Opening& at, std::int32_t material) {
    add_face(mesh, {V(x, at.u1, at.v0), V(0, at.u0 - at.u1, 0), V(0, 0, at.v1 - at.v0)},
             {material, outside, {0, 0}});
  };
  // All of it so large that no flight sees past it.
  sheet(kLength + 14, {-40, 50, -20, 40}, bright);
  const double corner = d.random.uniform(2.5, 5), eaves = d.random.uniform(2.6, 3.8);
  sheet(kLength + 9, {-30, corner, -15, eaves}, wall);
  sheet(kLength + 10, {-30, corner + 0.4, eaves - 0.3, eaves + 1.1}, roof);
  sheet(kLength + 12, {corner - 1, 40, -15, d.random.uniform(1.2, 1.9)}, roof);
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 6; ++j)
      sheet(kLength + 9 - 0.01,
            {corner - 1.5 - 1.6 * i, corner - 0.6 - 1.6 * i, eaves - 1.7 - 1.9 * j, eaves - 0.5 - 1.9 * j},
            pane);
}

void add_lights(WorldBuilder& d, const Hall& h) {
  Scene& scene = d.scene;
  constexpr double kFill = 0.3;  // fraction of the lamp light that walls and ceiling reflect
  const double lengths[3] = {1.4, 3.9, 6.6};
  const V middle(0.5 * kLength, 0.5 * kWidth, 0.75);
  for (int i = 0; i < 3; ++i) {
    Light lamp;
    lamp.name = "lamp";
    lamp.kind = LightKind::lamp;
    lamp.position = V(lengths[i], 0.5 * kWidth + d.random.uniform(-0.5, 0.5), kHeight - 0.27);
    lamp.radius = 0.15;
    lamp.strength = 1;
    scene.lights.push_back(lamp);
  }
  const double candela = (1 - kFill) * d.config.lamp_lux / lamp_lux_at(scene, middle);
  const std::int32_t glow = d.materials.add_emissive("lamp glass", candela / 0.26, 0);
  for (Light& lamp : scene.lights) {
    lamp.strength = candela;
    const V half(0.11, 0.65, 0.03), at = lamp.position + V(0, 0, 0.07);
    const std::int32_t object = d.add_object("lamp");
    add_box_between(scene.mesh, at - half, at + half, d.finish(h.furniture.metal, object),
                    all_sides & ~static_cast<unsigned>(side_below));
    add_face(scene.mesh,
             {at + V(-half.x(), half.y(), -half.z()), V(2 * half.x(), 0, 0), V(0, -2 * half.y(), 0)},
             {glow, object, {0, 0}});
    for (const double y : {-0.45, 0.45})
      put_post(d, at + V(0, y, half.z()), {0.008, kHeight - at.z() - half.z(), 10},
               d.finish(h.furniture.metal, object), false);
  }
  Light fill;
  fill.name = "fill";
  fill.strength = kFill * d.config.lamp_lux;
  scene.lights.push_back(fill);
  const double window = d.config.night ? 0.02 : d.config.window_cd_m2;
  Light daylight;
  daylight.name = "window";
  daylight.kind = LightKind::lamp;
  daylight.daylight = true;
  daylight.position =
      V(kLength + 0.6, 0.5 * (kWindow.u0 + kWindow.u1), 0.5 * (kWindow.v0 + kWindow.v1) + 0.2);
  daylight.radius = 0.5;
  // A third of the pane's flux: the lower half of the view is darker than the sky.
  daylight.strength = window * (kWindow.u1 - kWindow.u0) * (kWindow.v1 - kWindow.v0) / 3;
  scene.lights.push_back(daylight);
  Light indirect;
  indirect.name = "daylight";
  indirect.daylight = true;
  indirect.strength = 0.02 * window;
  scene.lights.push_back(indirect);
}

// A row of furniture along a wall from `begin` to `end`; `at(along)` is the placement.
struct WallRow {
  double begin, end, yaw;
  V origin, direction;
  double shelves;  // fraction of bookshelves; negative: nothing higher than a window sill
};
void furnish_wall(WorldBuilder& d, const Hall& h, const WallRow& row) {
  const FurnitureMaterials& m = h.furniture;
  double along = row.begin;
  while (along < row.end - 0.5) {
    const double width = std::min(d.random.uniform(0.75, 1.15), row.end - along);
    const V foot = row.origin + (along + 0.5 * width) * row.direction;
    const Placement place(foot, row.yaw);
    const Placement on_wall(place.T_map_object * Pose{Eigen::Quaterniond::Identity(), {0, kGap, 0}});
    const double pick = d.random.uniform();
    if (row.shelves < 0) {
      put_cupboard(d, m, place, {width, 0.42, 0.72});
    } else if (pick < row.shelves) {
      put_bookshelf(d, m, place, {width, d.random.uniform(0.3, 0.38), d.random.uniform(1.5, 2.25)});
    } else if (pick < 0.5 + 0.5 * row.shelves - 0.1) {
      put_cupboard(d, m, place, {width, d.random.uniform(0.38, 0.5), d.chance(0.5) ? 1.9 : 1.1});
    } else {
      put_cartons(d, m, Placement(place.T_map_object * Pose{{1, 0, 0, 0}, {0, -0.35, 0}}), 0.55, 0.95);
      if (d.chance(0.6))
        put_picture(d, m, on_wall, d.random.uniform(1.6, 1.9), d.random.uniform(0.6, 0.9),
                    d.random.uniform(0.6, 0.9));
      else
        put_poster(d, m, on_wall, -0.3, d.random.uniform(1.1, 1.6));
    }
    along += width + d.random.uniform(0.05, 0.22);
  }
}

void furnish(WorldBuilder& d, const Hall& h) {
  const FurnitureMaterials& m = h.furniture;
  furnish_wall(d, h, {0.35, 3.3, -kQuarter, {kLength - kGap, 0, 0}, {0, 1, 0}, 0.85});
  furnish_wall(d, h, {3.45, 5.3, -kQuarter, {kLength - kGap, 0, 0}, {0, 1, 0}, -1});
  furnish_wall(d, h, {1.0, 7.3, std::numbers::pi, {0, kGap, 0}, {1, 0, 0}, 0.55});
  furnish_wall(d, h, {0.4, 7.2, 0, {0, kWidth - kGap, 0}, {1, 0, 0}, 0.55});
  furnish_wall(d, h, {0.8, 5.2, kQuarter, {kGap, 0, 0}, {0, 1, 0}, 0.55});
  for (int i = 0; i < 3; ++i)  // above what stands at the walls
    put_poster(d, m, Placement({1.2 + 2.2 * i, 0, 0}, std::numbers::pi), -0.3,
               2.28 - 0.2 * d.random.uniform());
  // Two tables beyond the aisle, chairs at them, a table behind.
  for (const double y : {1.75, 4.2}) {
    const Placement table({6.65 + d.random.uniform(-0.08, 0.08), y + d.random.uniform(-0.12, 0.12), 0},
                          -kQuarter + d.random.uniform(-0.12, 0.12));
    put_table(d, m, table, {d.random.uniform(1.25, 1.6), d.random.uniform(0.65, 0.75), 0.73});
    for (const double side : {-0.36, 0.36})
      put_chair(d, m,
                Placement(table.T_map_object *
                          Pose{so3::exp(V(0, 0, std::numbers::pi + d.random.uniform(-0.4, 0.4))),
                               {side, -0.55, 0}}));
  }
}

void add_pillars(WorldBuilder& d, const Hall& h) {
  const std::int32_t round = d.add_object("round pillar"), square = d.add_object("square pillar");
  const double y = d.random.uniform(0.75, 0.95), swap = d.chance(0.5) ? 1 : -1;
  const V a(5.9, 3 - swap * (3 - y), 0), b(6.1, 3 + swap * (3 - y), 0);
  put_post(d, a, {0.17, kHeight, 48}, d.finish(h.pillar, round), false);
  add_box_on(d.scene.mesh, b, {0.32, 0.32, kHeight}, 0, d.finish(h.pillar, square), kUpright);
  add_box_on(d.scene.mesh, b, {0.42, 0.42, 0.12}, 0, d.finish(h.pillar, square), kOnFloor);
}

// Below the flight: a carpet, cartons and a low table.
void add_floor_things(WorldBuilder& d, const Hall& h) {
  add_print(d.scene.mesh, {V(1.6, 1.6, 0), V(3.2, 0, 0), V(0, 2.6, 0)}, {0.1, 3.1, 0.1, 2.5},
            d.finish(h.carpet, d.add_object("carpet")));
  const double xs[5] = {1.5, 2.7, 3.6, 4.6, 5.0}, ys[5] = {1.0, 5.0, 1.3, 4.7, 2.4};
  for (int i = 0; i < 5; ++i)
    put_cartons(d, h.furniture,
                Placement({xs[i] + d.random.uniform(-0.3, 0.3), ys[i] + d.random.uniform(-0.25, 0.25), 0},
                          d.random.uniform(0, 3)),
                d.random.uniform(0.3, 0.5), 0.72);
}

// A glass wall across the room between the flight and the tables: two panes in a frame. And a pane in the
// window, in the middle of its bars.
void add_glass(WorldBuilder& d, const Hall& h) {
  if (!d.config.glass_wall) return;
  constexpr double kX = 5.72, kLow = 1.35, kHigh = 4.65, kTop = 2.3, kDeep = 0.06, kBar = 0.07, kRail = 0.12;
  constexpr double kInFrame = 0.01;  // how deep the rim of a pane is in the frame
  Mesh& mesh = d.scene.mesh;
  const Finish frame{h.furniture.white, d.add_object("glass wall"), {0, 0}};
  const double middle = 0.5 * (kLow + kHigh), half = 0.5 * kBar, back = kX - 0.5 * kDeep,
               front = back + kDeep;
  for (const double y : {kLow, middle, kHigh})
    add_box_between(mesh, V(back, y - half, 0), V(front, y + half, kTop), frame, kOnFloor);
  for (const double y : {kLow, middle}) {
    const double from = y + half, to = y + middle - kLow - half;
    add_box_between(mesh, V(back, from, 0), V(front, to, kRail), frame, side_west | side_east | side_above);
    add_box_between(mesh, V(back, from, kTop - kBar), V(front, to, kTop), frame,
                    side_west | side_east | side_below | side_above);
    const V low(kX, from - kInFrame, kRail - kInFrame);
    d.scene.panes.push_back(
        {low, V(0, to - from + 2 * kInFrame, 0), V(0, 0, kTop - kBar - kRail + 2 * kInFrame)});
  }
  d.scene.panes.push_back({V(kLength + 0.125, kWindow.u0 - kInFrame, kWindow.v0 - kInFrame),
                           V(0, kWindow.u1 - kWindow.u0 + 2 * kInFrame, 0),
                           V(0, 0, kWindow.v1 - kWindow.v0 + 2 * kInFrame)});
}

void add_moving_things(WorldBuilder& d) {
  const MoversConfig& c = d.config.movers;
  if (c.fans + c.people == 0) return;
  const MoverMaterials m = add_mover_materials(d.materials, d.seed(), kTexel_m);
  const V places[3] = {{6.25, 3.0, 1.25}, {5.6, 0.55, 1.2}, {5.5, 5.5, 1.3}};
  for (int i = 0; i < c.fans; ++i) {
    Fan fan;
    fan.name = "fan " + std::to_string(i + 1);
    fan.T_map_fan = {so3::exp(V(0, 0, std::numbers::pi + 0.35 * (i - 0.5))), places[i]};
    fan.rpm = c.fan_rpm;
    fan.phase = i;
    fan.stand_to_z = 0;
    add_fan(d.scene, m, fan);
  }
  for (int i = 0; i < c.people; ++i) {
    Walker person;
    person.name = "person " + std::to_string(i + 1);
    // Up and down the aisle between flight and tables.
    person.path = {{5.35, 1.3, 0}, {5.3, 2.5, 0},  {5.3, 3.7, 0}, {5.4, 4.7, 0}, {5.75, 4.9, 0},
                   {5.9, 4.2, 0},  {5.85, 3.0, 0}, {5.9, 1.8, 0}, {5.75, 1.1, 0}};
    person.speed_m_s = c.walk_m_s;
    person.start_m = 8.0 * i / c.people + 0.7;
    person.height_m = d.random.uniform(1.6, 1.85);
    person.clothes = i;
    add_walker(d.scene, m, person);
  }
}

}  // namespace

void build_hall(WorldBuilder& builder) {
  builder.scene.name = "hall";
  builder.scene.low = {1.2, 1.2, 0.85};
  builder.scene.high = {5.2, 4.8, 2.4};
  const Hall hall = add_materials(builder);
  add_shell(builder, hall);
  add_window(builder, hall);
  add_lights(builder, hall);
  add_pillars(builder, hall);
  furnish(builder, hall);
  add_floor_things(builder, hall);
  add_moving_things(builder);
  add_glass(builder, hall);
}

}  // namespace evpose::sim
