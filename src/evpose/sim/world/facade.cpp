// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/facade.h"

#include <algorithm>
#include <cmath>

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;
constexpr double kReveal = 0.2, kBar = 0.05;
constexpr unsigned kOnWall = all_sides & ~static_cast<unsigned>(side_north);

struct Bay {
  Opening opening;  // along the facade from its left end
  bool door, balcony;
};

std::vector<Bay> bays(WorldBuilder& d, const Facade& f) {
  std::vector<Bay> all;
  const int columns = std::max(1, static_cast<int>(f.width / f.bay)),
            storeys = std::max(1, static_cast<int>(f.height / f.storey));
  const double first = 0.5 * (f.width - columns * f.bay);
  const int door = f.repeats ? 0 : d.pick(0, columns - 1);
  for (int j = 0; j < storeys; ++j) {
    for (int i = 0; i < columns; ++i) {
      const double middle = first + (i + 0.5) * f.bay, low = j * f.storey + f.sill;
      if (j == 0 && i == door) {
        all.push_back({{middle - 0.6, middle + 0.6, 0.04, 2.3}, true, false});
        continue;
      }
      if (!f.repeats && d.chance(0.06)) continue;  // bricked up
      const bool balcony = j > 0 && d.chance(f.balconies);
      all.push_back({{middle - 0.5 * f.window_width, middle + 0.5 * f.window_width, low,
                      std::min(low + f.window_height, f.height - 0.3)},
                     false,
                     balcony});
    }
  }
  return all;
}

void put_window(WorldBuilder& d, const OutdoorMaterials& m, const Placement& place, const Opening& o,
                std::int32_t object, bool repeats) {
  const auto finish = [&](std::int32_t material) {
    return repeats ? Finish{material, object, {0, 0}} : d.finish(material, object);
  };
  const double back = kReveal, front = kReveal - kBar, middle = 0.5 * (o.u0 + o.u1),
               cross = o.v0 + 0.62 * (o.v1 - o.v0);
  const Finish bars = finish(m.frame);
  add_face(d.scene.mesh,
           {place.T_map_object * V(o.u0, back, o.v0), place.T_map_object.q * V(o.u1 - o.u0, 0, 0),
            place.T_map_object.q * V(0, 0, o.v1 - o.v0)},
           finish(m.glass));
  put_box(d, place, V(middle - 0.5 * kBar, front, o.v0), V(middle + 0.5 * kBar, back, o.v1), bars,
          side_west | side_east | side_south);
  for (const auto& [u0, u1] : {std::pair{o.u0, middle - 0.5 * kBar}, std::pair{middle + 0.5 * kBar, o.u1}})
    put_box(d, place, V(u0, front, cross - 0.5 * kBar), V(u1, back, cross + 0.5 * kBar), bars,
            side_south | side_below | side_above);
  put_box(d, place, V(o.u0 - 0.08, -0.09, o.v0 - 0.08), V(o.u1 + 0.08, 0, o.v0 - 0.015), finish(m.ledge),
          kOnWall);
  if (repeats || d.chance(0.6))  // lintel
    put_box(d, place, V(o.u0 - 0.1, -0.05, o.v1 + 0.02), V(o.u1 + 0.1, 0, o.v1 + 0.2), finish(m.ledge),
            kOnWall);
}

void put_balcony(WorldBuilder& d, const OutdoorMaterials& m, const Placement& place, const Opening& o,
                 std::int32_t object) {
  const double u0 = o.u0 - 0.35, u1 = o.u1 + 0.35, z = o.v0 - 0.3, deep = 0.8;
  put_box(d, place, V(u0, -deep, z - 0.14), V(u1, 0, z), d.finish(m.concrete, object), kOnWall);
  const int bars = static_cast<int>((u1 - u0) / 0.16);
  for (int i = 0; i <= bars; ++i) {
    const double u = u0 + 0.02 + i * (u1 - u0 - 0.06) / bars;
    put_box(d, place, V(u, -deep + 0.02, z), V(u + 0.02, -deep + 0.04, z + 0.8), d.finish(m.pole, object),
            side_west | side_east | side_south | side_north);
  }
  put_box(d, place, V(u0, -deep, z + 0.8), V(u1, -deep + 0.06, z + 0.85), d.finish(m.pole, object));
  for (const double u : {u0, u1 - 0.04})
    put_box(d, place, V(u, -deep + 0.06, z + 0.81), V(u + 0.04, 0, z + 0.845), d.finish(m.pole, object),
            side_west | side_east | side_below | side_above);
}

}  // namespace

OutdoorMaterials add_outdoor_materials(WorldBuilder& d, double texel_m) {
  OutdoorMaterials m;
  const Repeat wide{6, 6}, small{3, 3};
  const auto tone = [&](double low, double high) { return d.random.uniform(low, high); };
  const auto wall = [&](const char* name, Pattern pattern) {
    m.walls.push_back(d.materials.add_textured(name, tone(0.8, 1.15), wide, texel_m, std::move(pattern)));
  };
  wall("brick wall", bricks(wide, d.seed()));
  wall("stucco", stucco(wide, d.seed()));
  wall("concrete wall", concrete(wide, d.seed()));
  wall("painted wall", graffiti(wide, d.seed()));
  m.walls.push_back(d.materials.add_with_tone("dark bricks", tone(0.5, 0.7), m.walls[0]));
  m.walls.push_back(d.materials.add_with_tone("bright stucco", tone(1.2, 1.4), m.walls[1]));
  const auto ground = [&](const char* name, Pattern pattern) {
    m.grounds.push_back(d.materials.add_textured(name, tone(0.6, 0.9), wide, texel_m, std::move(pattern)));
  };
  ground("paving", paving(wide, d.seed()));
  ground("asphalt", asphalt(wide, d.seed()));
  ground("gravel", gravel(wide, d.seed()));
  ground("grass", grass(wide, d.seed()));
  m.concrete = d.materials.add_textured("concrete", 0.95, small, 0.004, concrete(small, d.seed()));
  m.container = d.materials.add_textured("container", tone(0.6, 0.9), {4, 2.4}, 0.004,
                                         container_side({4, 2.4}, d.seed()));
  m.glass =
      d.materials.add_textured("window panes", 0.9, {4, 4}, 0.006, window_panes({4, 4}, 0.55, d.seed()));
  d.materials.set_mirror(m.glass, d.config.mirror);
  m.door = d.materials.add_textured("doors", tone(0.4, 0.8), small, 0.004, planks(small, 0.14, d.seed()));
  m.frame = d.materials.add_with_tone("window frames", tone(1.0, 1.5), m.concrete);
  m.ledge = d.materials.add_with_tone("ledges", tone(1.0, 1.4), m.concrete);
  m.pole = d.materials.add_with_tone("poles", tone(0.25, 0.5), m.container);
  m.lamp = d.config.night ? d.materials.add_emissive("street lamp", 3e3 * d.config.lamp_lux / 20, -1)
                          : d.materials.add_plain("street lamp", 0.7);
  return m;
}

void put_facade(WorldBuilder& d, const OutdoorMaterials& m, const Placement& place, const Facade& f) {
  const std::int32_t object = d.add_object("facade");
  const Placement corner(place.T_map_object * Pose{Eigen::Quaterniond::Identity(), {-0.5 * f.width, 0, 0}});
  const std::vector<Bay> all = bays(d, f);
  std::vector<Opening> openings;
  for (const Bay& bay : all) openings.push_back(bay.opening);
  const Pose& T = corner.T_map_object;
  add_wall(d.scene.mesh, {T.p, T.q * V(f.width, 0, 0), T.q * V(0, 0, f.height)}, openings, kReveal,
           d.finish(f.wall, object), d.finish(m.ledge, object));
  for (const Bay& bay : all) {
    if (bay.door) {
      const Opening& o = bay.opening;
      const double width = o.u1 - o.u0, height = o.v1 - o.v0;
      const std::int32_t door = d.add_object("door");
      add_face(d.scene.mesh, {T * V(o.u0, kReveal, o.v0), T.q * V(width, 0, 0), T.q * V(0, 0, height)},
               d.finish(m.door, door));
      for (const double z : {o.v0 + 0.2, o.v0 + 1.2})
        put_box(d, corner, V(o.u0 + 0.2, kReveal - 0.03, z), V(o.u1 - 0.2, kReveal, z + 0.75),
                d.finish(m.door, door), kOnWall);
      put_box(d, corner, V(o.u0 - 0.2, -0.4, 0), V(o.u1 + 0.2, 0, 0.12), d.finish(m.concrete, door),
              kOnWall & ~static_cast<unsigned>(side_below));
    } else {
      put_window(d, m, corner, bay.opening, object, f.repeats);
    }
    if (bay.balcony) put_balcony(d, m, corner, bay.opening, object);
  }
  const int storeys = static_cast<int>(f.height / f.storey);
  for (int j = 1; j < storeys; ++j) {
    if (f.balconies > 0 && !d.chance(0.5)) continue;
    const double z = j * f.storey - 0.02;
    put_box(d, corner, V(0, -0.1, z - 0.14), V(f.width, 0, z), d.finish(m.ledge, object), kOnWall);
  }
  put_box(d, corner, V(0, -0.28, f.height - 0.22), V(f.width, 0, f.height), d.finish(m.ledge, object),
          kOnWall);
  put_box(d, corner, V(0, -0.06, 0), V(f.width, 0, 0.04), d.finish(m.concrete, object),
          side_south | side_above);
}

void put_lamp_post(WorldBuilder& d, const OutdoorMaterials& m, const Placement& place, double height_m,
                   double arm_m) {
  const std::int32_t object = d.add_object("lamp post");
  put_post(d, place.T_map_object.p, {0.12, 0.7, 24}, d.finish(m.pole, object));
  put_post(d, place.T_map_object * V(0, 0, 0.7), {0.06, height_m - 0.7, 20}, d.finish(m.pole, object));
  put_box(d, place, V(-0.04, -arm_m, height_m - 0.3), V(0.04, -0.055, height_m - 0.2),
          d.finish(m.pole, object), all_sides & ~static_cast<unsigned>(side_north));
  const V low(-0.14, -arm_m - 0.6, height_m - 0.34), high(0.14, -arm_m, height_m - 0.18);
  put_box(d, place, low, high, d.finish(m.pole, object), all_sides & ~static_cast<unsigned>(side_below));
  const Pose& T = place.T_map_object;
  add_face(d.scene.mesh, {T * V(low.x(), high.y(), low.z()), T.q * V(0.28, 0, 0), T.q * V(0, -0.6, 0)},
           {m.lamp, object, {0, 0}});
  if (!d.config.night) return;
  Light light;
  light.name = "street lamp";
  light.kind = LightKind::lamp;
  light.position = T * V(0, -arm_m - 0.3, height_m - 0.42);
  light.radius = 0.12;
  light.strength =
      d.config.lamp_lux / 20 * height_m * height_m;  // a twentieth of lamp_lux on the ground below
  d.scene.lights.push_back(light);
}

}  // namespace evpose::sim
