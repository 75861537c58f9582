// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/sim/world/facade.h"
#include "evpose/sim/world/furniture.h"

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;
constexpr double kLength = 100;            // along x
constexpr double kKerb = 4, kFront = 7.2;  // half widths of road and street
constexpr double kPavement = 0.14;         // over the road
constexpr double kHalfTurn = std::numbers::pi;
constexpr unsigned kOnGround = all_sides & ~static_cast<unsigned>(side_below);

class Street {
 public:
  explicit Street(WorldBuilder& builder) : d_(builder) {}

  void lay_out() {
    m_ = add_outdoor_materials(d_, 0.006);
    furniture_ = add_furniture_materials(d_, 0.004);
    movers_ = add_mover_materials(d_.materials, d_.seed(), 0.004);
    add_daylight(d_);
    add_ground();
    for (const double side : {1.0, -1.0}) {
      add_buildings(side);
      add_pavement_things(side);
      add_parked_cars(side);
    }
    add_ends();
    add_moving_things();
  }

 private:
  // Things on a side of the street: `side` 1 is +y. Faces the road.
  static Placement facing_road(double x, double y, double z, double side) {
    return Placement(V(x, side * y, z), side > 0 ? 0 : kHalfTurn);
  }

  void add_ground() {
    Mesh& mesh = d_.scene.mesh;
    const std::int32_t road = d_.add_object("road"), pavement = d_.add_object("pavement");
    add_face(mesh, {V(-30, -kKerb, 0), V(kLength + 60, 0, 0), V(0, 2 * kKerb, 0)},
             d_.finish(m_.grounds[1], road));
    const Face whole{V(-30, -kKerb, 0), V(kLength + 60, 0, 0), V(0, 2 * kKerb, 0)};
    for (double x = 32; x < kLength + 26; x += 6) {  // worn lane marks
      const double length = d_.random.uniform(2.4, 3.2);
      add_print(mesh, whole, {x, x + length, kKerb - 0.07, kKerb + 0.07}, d_.finish(furniture_.white, road));
    }
    for (int i = 0; i < 8; ++i) {  // covers of shafts
      const double x = 34 + 11.5 * i + d_.random.uniform(0, 3), y = kKerb + (d_.chance(0.5) ? 1.2 : -1.9);
      add_print(mesh, whole, {x, x + 0.7, y, y + 0.7}, d_.finish(m_.container, road));
    }
    for (const double side : {1.0, -1.0}) {
      const double y0 = side > 0 ? kKerb : -14.0, y1 = side > 0 ? 14.0 : -kKerb;
      add_box_between(mesh, V(-30, y0, 0), V(kLength + 30, y1, kPavement), d_.finish(m_.grounds[0], pavement),
                      side_above);
      const double k0 = side > 0 ? kKerb - 0.15 : -kKerb, k1 = side > 0 ? kKerb : -kKerb + 0.15;
      add_box_between(mesh, V(-30, k0, 0), V(kLength + 30, k1, kPavement - 0.015),
                      d_.finish(m_.concrete, pavement), side_north | side_south | side_above);
      add_face(mesh,
               side > 0
                   ? Face{V(-30, kKerb, kPavement - 0.015), V(kLength + 60, 0, 0), V(0, 0, 0.015)}
                   : Face{V(kLength + 30, -kKerb, kPavement - 0.015), V(-kLength - 60, 0, 0), V(0, 0, 0.015)},
               d_.finish(m_.concrete, pavement));
    }
  }

  Facade repeated_house() const {
    Facade f;
    f.width = 12;
    f.height = 12;
    f.bay = 2.4;
    f.storey = 3;
    f.wall = m_.walls[0];
    f.repeats = true;
    return f;
  }

  void add_buildings(double side) {
    for (double x = -12; x < kLength + 10;) {
      Facade f;
      f.width = d_.random.uniform(9, 16);
      f.height = d_.random.uniform(9.5, 19);
      f.bay = d_.random.uniform(2.1, 2.9);
      f.storey = d_.random.uniform(2.9, 3.5);
      f.window_width = d_.random.uniform(0.9, 1.4);
      f.window_height = d_.random.uniform(1.3, 1.8);
      f.balconies = d_.chance(0.4) ? 0.4 : 0;
      f.wall = m_.walls[static_cast<std::size_t>(d_.pick(0, static_cast<int>(m_.walls.size()) - 1))];
      double front = kFront + d_.random.uniform(0, 0.7);
      const double deep = 9;
      if (d_.config.repeated_facades) {
        f = repeated_house();
        front = kFront;
      }
      put_facade(d_, m_, facing_road(x + 0.5 * f.width, front, kPavement, side), f);
      // The house behind its facade: sides and roof.
      const double y0 = side > 0 ? front : -front - deep, y1 = side > 0 ? front + deep : -front;
      add_box_between(d_.scene.mesh, V(x, y0, kPavement), V(x + f.width, y1, f.height + kPavement),
                      d_.finish(f.wall, d_.add_object("house")), side_west | side_east | side_above);
      if (!f.repeats) shop(side, x, f.width, front);
      x += f.width + (!f.repeats && d_.chance(0.12) ? d_.random.uniform(3, 5) : 0.0);
    }
  }

  // An awning and a sign.
  void shop(double side, double x, double width, double front) {
    if (!d_.chance(0.6)) return;
    const std::int32_t object = d_.add_object("shop");
    const Placement place = facing_road(x + d_.random.uniform(0.3, 0.7) * width, front, kPavement, side);
    put_box(d_, place, V(-1.2, -0.14, 2.45), V(1.2, 0, 2.75), d_.finish(m_.container, object),
            all_sides & ~static_cast<unsigned>(side_north));
    if (d_.chance(0.5))
      put_box(d_, place, V(1.6, -0.7, 2.6), V(1.66, -0.1, 3.3), d_.finish(furniture_.posters[0], object));
  }

  void add_pavement_things(double side) {
    for (double x = 3; x < kLength; x += 4.5) {
      const double at = x + d_.random.uniform(-0.8, 0.8), pick = d_.random.uniform();
      const Placement near_kerb = facing_road(at, 4.75, kPavement, side),
                      near_wall = facing_road(at, 6.4, kPavement, side);
      if (pick < 0.2) {
        put_bench(d_, furniture_, near_wall, 1.5);
      } else if (pick < 0.4) {
        put_cartons(d_, furniture_, near_wall, d_.random.uniform(0.5, 0.8), 1.2);
      } else if (pick < 0.55) {
        const std::int32_t object = d_.add_furniture("bin");
        put_post(d_, near_kerb.T_map_object.p, {0.24, 0.85, 28}, d_.finish(m_.container, object));
      } else if (pick < 0.75) {
        for (int i = 0; i < 4; ++i)
          put_post(d_, near_kerb.T_map_object * V(0.7 * i - 1, 0, 0), {0.07, 0.8, 20},
                   d_.finish(m_.pole, d_.add_object("bollard")));
      } else if (pick < 0.9) {
        const std::int32_t object = d_.add_furniture("planter");
        put_box(d_, near_kerb, V(-0.7, -0.25, 0), V(0.7, 0.25, 0.5), d_.finish(m_.concrete, object),
                kOnGround);
        put_box(d_, near_kerb, V(-0.6, -0.17, 0.5), V(0.6, 0.17, 0.8), d_.finish(m_.grounds[3], object),
                kOnGround);
      }
    }
    const double first = side > 0 ? 6 : 16;
    for (double x = first; x < kLength; x += 20)
      put_lamp_post(d_, m_, facing_road(x, 4.3, kPavement, side), 6.2, 0.5);
  }

  void add_parked_cars(double side) {
    for (double x = 5; x < kLength - 4; x += 5.4) {
      if (!d_.chance(0.6)) continue;
      const double at = x + d_.random.uniform(-0.3, 0.3);
      const Pose T{so3::exp(V(0, 0, (side > 0 ? kHalfTurn : 0) + d_.random.uniform(-0.03, 0.03))),
                   V(at, side * d_.random.uniform(2.92, 2.98), 0)};
      add_parked_car(d_.scene.mesh, movers_, T, d_.pick(0, 2), d_.add_furniture("parked car"));
    }
  }

  void add_ends() {
    Facade f;
    f.width = 28;
    f.height = 14;
    f.repeats = d_.config.repeated_facades;
    f.wall = m_.walls[1];
    put_facade(d_, m_, Placement(V(kLength + 25, 0, 0), -0.5 * kHalfTurn), f);
    f.wall = m_.walls[0];
    put_facade(d_, m_, Placement(V(-25, 0, 0), 0.5 * kHalfTurn), f);
  }

  void add_moving_things() {
    const MoversConfig& c = d_.config.movers;
    for (int i = 0; i < c.fans; ++i) {  // of air conditioning, on the facades
      Fan fan;
      fan.name = "fan " + std::to_string(i + 1);
      const double side = i % 2 == 0 ? 1 : -1;
      fan.T_map_fan = {so3::exp(V(0, 0, -side * 0.5 * kHalfTurn)), V(18 + 12 * i, side * 6.3, 2.2)};
      fan.radius_m = 0.6;
      fan.rpm = c.fan_rpm;
      fan.stand_to_z = kPavement;
      add_fan(d_.scene, movers_, fan);
    }
    for (int i = 0; i < c.people; ++i) {
      Walker person;
      person.name = "person " + std::to_string(i + 1);
      const double side = i % 2 == 0 ? 1 : -1;
      person.path = loop(5.25, 5.75, side, kPavement);
      person.speed_m_s = c.walk_m_s;
      person.start_m = 14 + 9.0 * i;
      person.height_m = d_.random.uniform(1.6, 1.85);
      person.clothes = i;
      add_walker(d_.scene, movers_, person);
    }
    for (int i = 0; i < c.cars; ++i) {
      Car car;
      car.name = "car " + std::to_string(i + 1);
      car.path = loop(-1.15, 1.15, 1, 0);
      car.speed_m_s = c.car_m_s;
      car.start_m = 20 + 30.0 * i;  // drives off before who hovers over the start of the street
      car.paint = i;
      add_car(d_.scene, movers_, car);
    }
  }

  // Up and down the street between two lines along it.
  static std::vector<V> loop(double y0, double y1, double side, double z) {
    std::vector<V> points;
    const double end = kLength + 14, step = 4;
    for (double x = -14; x < end; x += step) points.emplace_back(x, side * y0, z);
    points.emplace_back(end + 1, side * 0.5 * (y0 + y1), z);
    for (double x = end - 2; x > -16; x -= step) points.emplace_back(x, side * y1, z);
    points.emplace_back(-17, side * 0.5 * (y0 + y1), z);
    return points;
  }

  WorldBuilder& d_;
  OutdoorMaterials m_;
  FurnitureMaterials furniture_;
  MoverMaterials movers_;
};

}  // namespace

void build_canyon(WorldBuilder& d) {
  d.scene.name = "canyon";
  d.scene.low = {3, -1.9, 0.8};
  d.scene.high = {97, 1.9, 6};
  Street(d).lay_out();
}

}  // namespace evpose::sim
