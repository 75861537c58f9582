// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/sim/world/facade.h"
#include "evpose/sim/world/furniture.h"
#include "evpose/sim/world/printed_things.h"

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;
constexpr double kHalfX = 12, kHalfY = 10;  // of the yard, metres
constexpr double kPad = 1.5, kPadTop = 0.3;
constexpr double kInnerX = 7.6, kInnerY = 5.7;  // inside the lane that cars and people use
constexpr double kQuarter = 0.5 * std::numbers::pi;
constexpr unsigned kOnGround = all_sides & ~static_cast<unsigned>(side_below);

// Free for the descent: above a cone of 45 degrees from the pad's rim.
double highest_at(double distance_m) { return kPadTop + distance_m - 0.75 * kPad; }

class Yard {
 public:
  explicit Yard(WorldBuilder& builder) : d_(builder) {}

  void lay_out() {
    const double texel = 0.005;
    m_ = add_outdoor_materials(d_, texel);
    furniture_ = add_furniture_materials(d_, 0.004);
    add_daylight(d_);
    add_ground();
    add_facades();
    add_pillars();
    add_things();
    add_along_walls();
    add_moving_things();
  }

 private:
  void add_ground() {
    const std::int32_t ground = d_.add_object("ground"), pad = d_.add_object("landing pad");
    const int kind = d_.chance(0.7) ? 0 : 1;
    Mesh& mesh = d_.scene.mesh;
    const Face face{V(-kHalfX, -kHalfY, 0), V(2 * kHalfX, 0, 0), V(0, 2 * kHalfY, 0)};
    add_face(mesh, face, d_.finish(m_.grounds[static_cast<std::size_t>(kind)], ground));
    if (d_.config.pad_mark == PadMark::none)
      add_box_on(mesh, V(0, 0, 0), {kPad, kPad, kPadTop}, 0, d_.finish(m_.concrete, pad), kOnGround);
    else
      add_landing_pad(mesh, Pose(), {kPad, kPadTop, d_.config.pad_mark}, d_.finish(m_.concrete, pad),
                      d_.finish(m_.pole, pad));
    // Patches of other ground in the four quarters, apart from each other.
    for (int i = 0; i < 4; ++i) {
      const double sx = i & 1 ? 1 : -1, sy = i & 2 ? 1 : -1;
      const double width = d_.random.uniform(2, 4.5), height = d_.random.uniform(1.5, 3);
      const double x = kHalfX + sx * d_.random.uniform(3.2, 4.6),
                   y = kHalfY + sy * d_.random.uniform(2.6, 3.6);
      add_print(mesh, face, {x - 0.5 * width, x + 0.5 * width, y - 0.5 * height, y + 0.5 * height},
                d_.finish(m_.grounds[static_cast<std::size_t>(2 + (i & 1))], ground));
    }
  }

  void add_facades() {
    for (int side = 0; side < 4; ++side) {
      const bool along_x = side % 2 == 0;
      Facade f;
      f.width = 2 * (along_x ? kHalfX : kHalfY);
      f.height = d_.random.uniform(6.8, 8.5);
      f.bay = d_.random.uniform(1.9, 2.5);
      f.storey = d_.random.uniform(2.9, 3.3);
      f.window_width = d_.random.uniform(0.9, 1.25);
      f.window_height = d_.random.uniform(1.3, 1.6);
      f.wall = m_.walls[static_cast<std::size_t>(d_.pick(0, static_cast<int>(m_.walls.size()) - 1))];
      if (d_.config.repeated_facades) {
        f.height = 7.5;
        f.bay = 2;
        f.storey = 3;
        f.window_width = 1.1;
        f.window_height = 1.5;
        f.wall = m_.walls[0];
        f.repeats = true;
      }
      const double yaw = -side * kQuarter;  // faces inwards
      const V foot = so3::exp(V(0, 0, yaw)) * V(0, along_x ? kHalfY : kHalfX, 0);
      put_facade(d_, m_, Placement(foot, yaw), f);
    }
  }

  // A row of pillars under a beam before one facade, and single ones in the yard.
  void add_pillars() {
    const std::int32_t object = d_.add_object("colonnade");
    const double y = 8.7, top = 3.3;
    for (int i = 0; i < 8; ++i)
      put_post(d_, V(-8.75 + 2.5 * i, y, 0), {0.19, top, 32}, d_.finish(m_.concrete, object), false);
    add_box_between(d_.scene.mesh, {-9.2, y - 0.25, top}, {9.2, y + 0.25, top + 0.4},
                    d_.finish(m_.ledge, object));
    const double at = d_.random.uniform(6.2, 7.0);
    for (const double sx : {-1.0, 1.0}) {
      const double height = d_.random.uniform(2.6, 3.8);
      const V foot(sx * at, -sx * d_.random.uniform(3.6, 5.0), 0);
      const std::int32_t pillar = d_.add_object("pillar");
      if (d_.chance(0.5))
        put_post(d_, foot, {0.22, height, 32}, d_.finish(m_.walls[0], pillar));
      else
        add_box_on(d_.scene.mesh, foot, {0.42, 0.42, height}, d_.random.uniform(0, 1.5),
                   d_.finish(m_.walls[2], pillar), kOnGround);
      taken_.push_back({foot, 0.5});
    }
  }

  struct Circle {
    V middle;
    double radius;
  };
  // A free placement for an object of the given size; none if the search fails.
  bool find_place(double radius, double height, V& foot) {
    for (int trial = 0; trial < 200; ++trial) {
      foot = V(d_.random.uniform(-kInnerX + radius, kInnerX - radius),
               d_.random.uniform(-kInnerY + radius, kInnerY - radius), 0);
      // A hand's breadth below the cone.
      if (highest_at(foot.norm() - radius) < height + 0.1) continue;
      if (std::any_of(taken_.begin(), taken_.end(),
                      [&](const Circle& c) { return (c.middle - foot).norm() < c.radius + radius + 0.15; }))
        continue;
      taken_.push_back({foot, radius});
      return true;
    }
    return false;
  }

  void add_things() {
    V foot;
    const auto yaw = [&] { return d_.random.uniform(0, 2 * kQuarter); };
    for (int i = 0; i < 4; ++i) {
      const V size(d_.random.uniform(1.3, 2.2), d_.random.uniform(0.9, 1.3), d_.random.uniform(0.8, 1.4));
      if (!find_place(0.5 * size.head<2>().norm(), size.z(), foot)) continue;
      const std::int32_t object = d_.add_furniture("container");
      add_box_on(d_.scene.mesh, foot, size, yaw(), d_.finish(m_.container, object), kOnGround);
    }
    for (int i = 0; i < 3; ++i) {
      const V size(d_.random.uniform(1.4, 2.2), 0.5, d_.random.uniform(0.35, 0.55));
      if (!find_place(0.5 * size.head<2>().norm(), size.z(), foot)) continue;
      const std::int32_t object = d_.add_furniture("planter");
      const double turn = yaw();
      add_box_on(d_.scene.mesh, foot, size, turn, d_.finish(m_.concrete, object),
                 kOnGround & ~static_cast<unsigned>(side_above));
      add_box_on(d_.scene.mesh, foot + V(0, 0, size.z()), {size.x() + 0.06, size.y() + 0.06, 0.06}, turn,
                 d_.finish(m_.ledge, object));
      const Placement top(foot + V(0, 0, size.z() + 0.06), turn);
      put_box(d_, top, V(-0.4 * size.x(), -0.15, 0), V(0.4 * size.x(), 0.15, d_.random.uniform(0.1, 0.25)),
              d_.finish(m_.grounds[3], object), kOnGround);
    }
    for (int i = 0; i < 3; ++i)
      if (find_place(0.85, 0.9, foot)) put_bench(d_, furniture_, Placement(foot, yaw()), 1.5);
    for (int i = 0; i < 2; ++i) {  // a board on two legs
      if (!find_place(0.95, 1.9, foot)) continue;
      const Placement place(foot, yaw());
      put_picture(d_, furniture_, Placement(place.T_map_object), 1.35, 1.7, 1.1);
      const std::int32_t object = d_.add_object("board");
      put_box(d_, place, V(-0.85, 0, 0.8), V(0.85, 0.03, 1.9), d_.finish(furniture_.metal, object));
      for (const double x : {-0.7, 0.64})
        put_box(d_, place, V(x, 0.03, 0), V(x + 0.06, 0.09, 1.8), d_.finish(m_.pole, object), kOnGround);
    }
    for (int i = 0; i < 9; ++i)
      if (find_place(0.5, 0.75, foot))
        put_cartons(d_, furniture_, Placement(foot, yaw()), d_.random.uniform(0.45, 0.75), 0.75);
    for (int i = 0; i < 12; ++i)
      if (find_place(0.28, 0.3, foot))
        put_cartons(d_, furniture_, Placement(foot, yaw()), d_.random.uniform(0.25, 0.4), 0.3);
  }

  void add_along_walls() {
    for (const double sx : {-1.0, 1.0})
      for (const double sy : {-1.0, 1.0})
        put_lamp_post(d_, m_, Placement(V(sx * 10.6, sy * 8.3, 0), sy > 0 ? 0 : 2 * kQuarter), 4.6, 0.3);
    for (int i = 0; i < 5; ++i) {
      const double x = -8 + 4 * i + d_.random.uniform(-0.8, 0.8);
      if (d_.chance(0.5))
        put_bench(d_, furniture_, Placement(V(x, -9.3, 0), 2 * kQuarter), 1.6);
      else
        put_cartons(d_, furniture_, Placement(V(x, -9.2, 0), d_.random.uniform(-0.3, 0.3)),
                    d_.random.uniform(0.6, 0.9), 1.6);
    }
    for (const double sx : {-1.0, 1.0})
      for (int i = 0; i < 3; ++i) {
        const double y = -5.5 + 5 * i + d_.random.uniform(-0.8, 0.8);
        const V size(d_.random.uniform(0.7, 1.1), d_.random.uniform(1, 2), d_.random.uniform(0.9, 1.7));
        add_box_on(d_.scene.mesh, V(sx * 11.1, y, 0), size, d_.random.uniform(-0.15, 0.15),
                   d_.finish(m_.container, d_.add_furniture("box")), kOnGround);
      }
  }

  // The lane round the inner yard, on the right.
  static std::vector<V> lane(double x, double y) {
    std::vector<V> points;
    for (int i = 0; i < 24; ++i) {
      const double a = 2 * std::numbers::pi * i / 24;
      // Between an ellipse and a rectangle.
      const double c = std::cos(a), s = std::sin(a),
                   r = std::pow(std::pow(std::abs(c), 5) + std::pow(std::abs(s), 5), -0.2);
      points.emplace_back(x * r * c, y * r * s, 0);
    }
    return points;
  }

  void add_moving_things() {
    const MoversConfig& c = d_.config.movers;
    if (c.fans + c.people + c.cars == 0) return;
    const MoverMaterials m = add_mover_materials(d_.materials, d_.seed(), 0.004);
    for (int i = 0; i < c.fans; ++i) {
      Fan fan;
      fan.name = "fan " + std::to_string(i + 1);
      const double angle = 0.6 + 2.1 * i;
      fan.T_map_fan = {so3::exp(V(0, 0, angle + 2 * kQuarter)),
                       V(3.4 * std::cos(angle), 3.4 * std::sin(angle), 1.3)};
      fan.radius_m = 0.5;
      fan.rpm = c.fan_rpm;
      fan.phase = i;
      fan.stand_to_z = 0;
      add_fan(d_.scene, m, fan);
    }
    const std::vector<V> walk = lane(8.2, 6.3), drive = lane(9.1, 7.1);
    for (int i = 0; i < c.people; ++i) {
      Walker person;
      person.name = "person " + std::to_string(i + 1);
      person.path = walk;
      if (i % 2 == 1) std::reverse(person.path.begin(), person.path.end());
      person.speed_m_s = c.walk_m_s;
      person.start_m = 50.0 * i / c.people + 3;
      person.height_m = d_.random.uniform(1.6, 1.85);
      person.clothes = i;
      add_walker(d_.scene, m, person);
    }
    for (int i = 0; i < c.cars; ++i) {
      Car car;
      car.name = "car " + std::to_string(i + 1);
      car.path = drive;
      car.speed_m_s = c.car_m_s;
      car.start_m = 55.0 * i / c.cars;
      car.paint = i;
      add_car(d_.scene, m, car);
    }
  }

  WorldBuilder& d_;
  OutdoorMaterials m_;
  FurnitureMaterials furniture_;
  std::vector<Circle> taken_;
};

}  // namespace

void build_courtyard(WorldBuilder& d) {
  d.scene.name = "courtyard";
  d.scene.low = {-4.5, -4.5, 0.4};
  d.scene.high = {4.5, 4.5, 7};
  Yard(d).lay_out();
}

}  // namespace evpose::sim
