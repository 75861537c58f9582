// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/movers.h"

#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "evpose/core/config.h"
#include "evpose/sim/world/closed_path.h"
#include "evpose/sim/world/material_library.h"
#include "evpose/sim/world/mesh_builder.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;
constexpr double kTurn = 2 * std::numbers::pi;

Pose turned(const V& position, const V& rotation) { return {so3::exp(rotation), position}; }
Pose shifted(const V& position) { return {Eigen::Quaterniond::Identity(), position}; }

std::int32_t add_object(Scene& scene, const std::string& name) {
  scene.objects.push_back(name);
  return static_cast<std::int32_t>(scene.objects.size() - 1);
}

// Upright, looking along the path.
Pose on_path(const ClosedPath::At& at) {
  return turned(at.position, {0, 0, std::atan2(at.tangent.y(), at.tangent.x())});
}

// A box around an axis that goes down from a joint at the origin.
Mesh limb(double length, double thick, const Finish& finish) {
  Mesh mesh;
  add_box(mesh, shifted({0, 0, -0.5 * length}), {thick, thick, length}, finish);
  return mesh;
}

/// Poses of the links of a walking body, by the distance walked.
class Gait {
 public:
  explicit Gait(const Walker& walker)
      : path_(walker.path), speed_(walker.speed_m_s), start_(walker.start_m), h_(walker.height_m) {}

  struct Limb {
    enum Kind { torso, head, upper_arm, forearm, thigh, shin, foot } kind;
    int side;  // 1 left, -1 right
  };
  Pose pose(const Limb& part, double t_s) const {
    const double way = start_ + speed_ * t_s;
    const double phase = kTurn * way / stride() + (part.side < 0 ? std::numbers::pi : 0);
    Pose T_map_body = on_path(path_.at(way)) * shifted({0, 0, hip() + 0.012 * h_ * std::cos(2 * phase)});
    switch (part.kind) {
      case Limb::torso:
        return T_map_body * turned({0, 0, 0}, {0, 0.05, 0.06 * std::sin(phase)});
      case Limb::head:
        return T_map_body * shifted({0.02 * h_, 0, 0.325 * h_});
      case Limb::upper_arm:
        return T_map_body * shoulder(part.side, phase);
      case Limb::forearm:
        return T_map_body * shoulder(part.side, phase) *
               turned({0, 0, -0.17 * h_}, {0, -0.35 - 0.25 * std::sin(phase), 0});
      case Limb::thigh:
        return T_map_body * thigh(part.side, phase);
      case Limb::shin:
        return T_map_body * thigh(part.side, phase) * knee(phase);
      case Limb::foot:
        return T_map_body * thigh(part.side, phase) * knee(phase) *
               turned({0, 0, -0.235 * h_}, {0, 0.25 * std::sin(phase), 0});
    }
    return T_map_body;
  }

 private:
  double stride() const { return 0.82 * h_; }
  double hip() const { return 0.51 * h_; }
  Pose shoulder(int side, double phase) const {
    return turned({0, side * 0.135 * h_, 0.29 * h_}, {side * 0.06, 0.45 * std::sin(phase), 0});
  }
  Pose thigh(int side, double phase) const {
    return turned({0, side * 0.055 * h_, 0}, {0, -0.08 - 0.45 * std::sin(phase), 0});
  }
  // Bent while the leg swings forward.
  Pose knee(double phase) const {
    return turned({0, 0, -0.24 * h_}, {0, 0.42 - 0.38 * std::sin(phase - 0.9), 0});
  }

  ClosedPath path_;
  double speed_, start_, h_;
};

constexpr double kWheelRadius = 0.32, kAxle = 1.3, kTrack = 0.76;

Mesh wheel(const MoverMaterials& m, std::int32_t object) {
  Mesh mesh;
  Cylinder tyre;
  tyre.radius_below = tyre.radius_above = kWheelRadius;
  tyre.height = 0.2;
  tyre.facets = 40;
  add_cylinder(mesh, turned({0, 0.1, 0}, {0.5 * std::numbers::pi, 0, 0}), tyre, {m.tyre, object, {0, 0}});
  // Spokes show that it rolls.
  for (int i = 0; i < 5; ++i)
    add_box(mesh, turned({0, 0, 0}, {0, kTurn * i / 5, 0}) * shifted({0.11, 0, 0}), {0.2, 0.23, 0.05},
            {m.metal, object, {0.2 * i, 0}});
  return mesh;
}

Mesh car_body(const MoverMaterials& m, int paint, std::int32_t object) {
  Mesh mesh;
  const Finish painted{m.paints[static_cast<std::size_t>(paint) % m.paints.size()], object, {0, 0}};
  const Finish glass{m.glass, object, {0.3, 0.1}}, dark{m.tyre, object, {0, 0}},
      bright{m.metal, object, {0, 0}};
  add_box_between(mesh, {-2.1, -0.85, 0.3}, {2.1, 0.85, 0.86}, painted);
  add_box_between(mesh, {-1.75, -0.76, 0.86}, {0.85, 0.76, 1.42}, painted,
                  all_sides & ~static_cast<unsigned>(side_below));
  add_box_between(mesh, {-2.18, -0.8, 0.36}, {-2.1, 0.8, 0.5}, dark,
                  all_sides & ~static_cast<unsigned>(side_east));
  add_box_between(mesh, {2.1, -0.8, 0.36}, {2.18, 0.8, 0.5}, dark,
                  all_sides & ~static_cast<unsigned>(side_west));
  for (const double x : {-1.65, -0.35}) {  // side windows, both sides
    const double width = x < -1 ? 1.2 : 1.1;
    add_print(mesh, {{x, -0.76, 0.9}, {width, 0, 0}, {0, 0, 0.42}}, {0, width, 0, 0.42}, glass);
    add_print(mesh, {{x + width, 0.76, 0.9}, {-width, 0, 0}, {0, 0, 0.42}}, {0, width, 0, 0.42}, glass);
  }
  add_print(mesh, {{0.85, -0.68, 0.9}, {0, 1.36, 0}, {0, 0, 0.44}}, {0, 1.36, 0, 0.44}, glass);
  add_print(mesh, {{-1.75, 0.68, 0.9}, {0, -1.36, 0}, {0, 0, 0.44}}, {0, 1.36, 0, 0.44}, glass);
  for (const double y : {-0.78, 0.48}) {
    add_print(mesh, {{2.1, y, 0.62}, {0, 0.3, 0}, {0, 0, 0.15}}, {0, 0.3, 0, 0.15}, bright);
    add_print(mesh, {{-2.1, y + 0.3, 0.62}, {0, -0.3, 0}, {0, 0, 0.15}}, {0, 0.3, 0, 0.15}, bright);
  }
  return mesh;
}

V wheel_place(int i) { return {i & 1 ? kAxle : -kAxle, i & 2 ? kTrack : -kTrack, kWheelRadius}; }

}  // namespace

void describe(ConfigTable& table, MoversConfig& c) {
  table.add("fans", c.fans, "", "rotating fans", {0, 3});
  table.add("fan_rpm", c.fan_rpm, "1/min", "speed of the fans", {-6000, 6000});
  table.add("people", c.people, "", "people who walk about", {0, 20});
  table.add("walk_m_s", c.walk_m_s, "m/s", "speed of the people", {0, 4});
  table.add("cars", c.cars, "", "cars that drive past; outside only", {0, 8});
  table.add("car_m_s", c.car_m_s, "m/s", "speed of the cars", {0, 40});
}

MoverMaterials add_mover_materials(MaterialLibrary& library, std::uint64_t seed, double texel_m) {
  MoverMaterials m;
  const Repeat small{1.2, 1.2}, wide{2, 1.2};
  for (std::uint64_t i = 0; i < 2; ++i) {
    const auto own = library.add_textured("clothes", 0.9, small, texel_m, cloth(small, mix(seed + i)));
    m.cloths.push_back(own);
    m.cloths.push_back(library.add_with_tone("dark clothes", 0.35, own));
  }
  const auto paint = library.add_textured("car paint", 0.5, wide, texel_m, plaster(wide, mix(seed + 5)));
  m.paints = {paint, library.add_with_tone("dark car paint", 0.2, paint),
              library.add_with_tone("bright car paint", 1.2, paint)};
  const auto rough = library.add_textured("rubber", 0.14, small, texel_m, plaster(small, mix(seed + 6)));
  m.tyre = rough;
  m.skin = library.add_with_tone("skin", 0.8, rough);
  m.hair = library.add_with_tone("hair", 0.2, rough);
  m.shoe = library.add_with_tone("shoe", 0.25, rough);
  m.metal = library.add_with_tone("bright metal", 1.4, rough);
  m.glass = library.add_textured("car glass", 0.8, small, texel_m, window_panes(small, 0.6, mix(seed + 7)));
  m.blade = library.add_textured("fan blade", 1.1, small, texel_m, tiles(small, 0.15, mix(seed + 8)));
  return m;
}

void add_fan(Scene& scene, const MoverMaterials& m, const Fan& fan) {
  const std::int32_t object = add_object(scene, fan.name);
  MovingPart& part = scene.moving.emplace_back();
  part.name = fan.name;
  // The axis is x; each blade lies slanted across the wind.
  Cylinder hub;
  hub.radius_below = hub.radius_above = 0.2 * fan.radius_m;
  hub.height = 0.16 * fan.radius_m;
  hub.facets = 24;
  const Pose along_x = turned({-0.5 * hub.height, 0, 0}, {0, 0.5 * std::numbers::pi, 0});
  add_cylinder(part.mesh, along_x, hub, {m.metal, object, {0, 0}});
  for (int i = 0; i < fan.blades; ++i) {
    const Pose T_fan_blade =
        turned({0, 0, 0}, {kTurn * i / fan.blades, 0, 0}) * turned({0, 0, 0.58 * fan.radius_m}, {0, 0, 0.45});
    add_box(part.mesh, T_fan_blade, {0.012, 0.42 * fan.radius_m, 0.84 * fan.radius_m},
            {m.blade, object, {0.31 * i, 0.17 * i}});
  }
  const double rate = fan.rpm / 60 * kTurn;
  part.T_map_part = [T = fan.T_map_fan, rate, phase = fan.phase](double t_s) {
    return T * turned({0, 0, 0}, {phase + rate * t_s, 0, 0});
  };
  // The post is static.
  const std::int32_t stand = add_object(scene, fan.name + " stand");
  const Pose T_map_motor = fan.T_map_fan * shifted({-0.09 - 0.5 * hub.height, 0, 0});
  add_box(scene.mesh, T_map_motor, {0.14, 0.12, 0.12}, {m.metal, stand, {0.4, 0}});
  const double z = T_map_motor.p.z() - 0.06, drop = z - fan.stand_to_z;
  if (drop <= 0.05 || drop > 10) return;
  Cylinder post;
  post.radius_below = post.radius_above = 0.02;
  post.height = drop - 0.03;
  post.facets = 20;
  post.lid_below = post.lid_above = false;
  const V foot(T_map_motor.p.x(), T_map_motor.p.y(), fan.stand_to_z);
  add_cylinder(scene.mesh, shifted(foot + V(0, 0, 0.03)), post, {m.metal, stand, {0, 0}});
  add_box_between(scene.mesh, foot - V(0.18, 0.18, 0), foot + V(0.18, 0.18, 0.03), {m.tyre, stand, {0, 0}},
                  all_sides & ~static_cast<unsigned>(side_below));
}

void add_walker(Scene& scene, const MoverMaterials& m, const Walker& walker) {
  const std::int32_t object = add_object(scene, walker.name);
  const auto gait = std::make_shared<const Gait>(walker);
  const double h = walker.height_m;
  const auto cloth_of = [&](int i) {
    return Finish{m.cloths[static_cast<std::size_t>(walker.clothes + i) % m.cloths.size()],
                  object,
                  {0.3 * walker.clothes, 0.2 * i}};
  };
  const Finish skin{m.skin, object, {0.1, 0.1}}, hair{m.hair, object, {0.1, 0.1}},
      shoe{m.shoe, object, {0, 0}};
  const auto add = [&](const std::string& name, Mesh mesh, Gait::Limb limb_of) {
    scene.moving.push_back({walker.name + "." + name, std::move(mesh),
                            [gait, limb_of](double t_s) { return gait->pose(limb_of, t_s); }});
  };
  Mesh torso, head;
  add_box(torso, shifted({0, 0, 0.15 * h}), {0.12 * h, 0.22 * h, 0.32 * h}, cloth_of(0));
  add("torso", std::move(torso), {Gait::Limb::torso, 1});
  add_box(head, shifted({0, 0, 0.075 * h}), {0.1 * h, 0.09 * h, 0.11 * h}, skin);
  add_box(head, shifted({-0.006 * h, 0, 0.145 * h}), {0.115 * h, 0.1 * h, 0.03 * h}, hair);
  add_box(head, shifted({0, 0, 0.0}), {0.05 * h, 0.05 * h, 0.04 * h}, skin);
  add("head", std::move(head), {Gait::Limb::head, 1});
  for (const int side : {1, -1}) {
    const std::string which = side > 0 ? "left " : "right ";
    add(which + "upper arm", limb(0.18 * h, 0.05 * h, cloth_of(0)), {Gait::Limb::upper_arm, side});
    add(which + "forearm", limb(0.22 * h, 0.042 * h, skin), {Gait::Limb::forearm, side});
    add(which + "thigh", limb(0.25 * h, 0.085 * h, cloth_of(1)), {Gait::Limb::thigh, side});
    add(which + "shin", limb(0.24 * h, 0.065 * h, cloth_of(1)), {Gait::Limb::shin, side});
    Mesh foot;
    add_box(foot, shifted({0.035 * h, 0, -0.018 * h}), {0.14 * h, 0.055 * h, 0.036 * h}, shoe);
    add(which + "foot", std::move(foot), {Gait::Limb::foot, side});
  }
}

void add_car(Scene& scene, const MoverMaterials& m, const Car& car) {
  const std::int32_t object = add_object(scene, car.name);
  struct Drive {
    ClosedPath path;
    double speed, start;
  };
  const auto drive = std::make_shared<const Drive>(Drive{ClosedPath(car.path), car.speed_m_s, car.start_m});
  scene.moving.push_back({car.name + ".body", car_body(m, car.paint, object), [drive](double t_s) {
                            return on_path(drive->path.at(drive->start + drive->speed * t_s));
                          }});
  for (int i = 0; i < 4; ++i) {
    scene.moving.push_back(
        {car.name + ".wheel " + std::to_string(i + 1), wheel(m, object), [drive, i](double t_s) {
           const double way = drive->start + drive->speed * t_s;
           return on_path(drive->path.at(way)) * turned(wheel_place(i), {0, way / kWheelRadius, 0});
         }});
  }
}

void add_parked_car(Mesh& mesh, const MoverMaterials& m, const Pose& T_map_car, int paint,
                    std::int32_t object) {
  add_mesh(mesh, car_body(m, paint, object), T_map_car);
  for (int i = 0; i < 4; ++i)
    add_mesh(mesh, wheel(m, object), T_map_car * turned(wheel_place(i), {0, 0.7 * i, 0}));
}

}  // namespace evpose::sim
