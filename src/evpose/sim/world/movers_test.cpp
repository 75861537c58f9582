// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/movers.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <set>

#include "evpose/sim/world/closed_path.h"

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;

// A lap of about 21 m with a narrow end.
const std::vector<V> kLap = {{0, 0, 0}, {3, 0.2, 0}, {6, 0, 0}, {8, 1.5, 0},
                             {6, 3, 0}, {3, 2.6, 0}, {0, 3, 0}};

MoverMaterials materials() {
  MoverMaterials m;
  m.cloths = {0, 1};
  m.paints = {2};
  return m;
}

TEST(ClosedPath, PassesItsPointsAndClosesAfterItsLength) {
  const ClosedPath path(kLap);
  for (const V& point : kLap) {
    double nearest = 1e9;
    for (double s = 0; s < path.length_m(); s += 0.002)
      nearest = std::min(nearest, (path.at(s).position - point).norm());
    EXPECT_LT(nearest, 0.0015);
  }
  EXPECT_LT((path.at(1.7).position - path.at(1.7 + 3 * path.length_m()).position).norm(), 1e-9);
  EXPECT_LT((path.at(-0.4).position - path.at(path.length_m() - 0.4).position).norm(), 1e-9);
}

TEST(ClosedPath, IsMeasuredByItsOwnLength) {
  const ClosedPath path(kLap);
  const double step = 1e-4;
  for (double s = 0; s < path.length_m(); s += 0.37) {
    const V difference = (path.at(s + step).position - path.at(s - step).position) / (2 * step);
    EXPECT_LT((difference - path.at(s).tangent).norm(), 1e-6);
  }
}

TEST(ClosedPath, ACircleHasItsCircumference) {
  std::vector<V> points;
  for (int i = 0; i < 16; ++i)
    points.emplace_back(2 * std::cos(i * std::numbers::pi / 8), 2 * std::sin(i * std::numbers::pi / 8), 1);
  const ClosedPath path(points);
  EXPECT_NEAR(path.length_m(), 4 * std::numbers::pi, 1e-4);
  for (double s = 0; s < 12; s += 0.1) EXPECT_NEAR(path.at(s).position.head<2>().norm(), 2, 1e-5);
}

TEST(Movers, AFanComesRoundAfterItsPeriod) {
  Scene scene;
  Fan fan;
  fan.rpm = 300;
  fan.T_map_fan = {so3::exp(V(0.1, 0.2, 0.3)), V(1, 2, 3)};
  add_fan(scene, materials(), fan);
  ASSERT_EQ(scene.moving.size(), 1u);
  const auto& at = scene.moving[0].T_map_part;
  EXPECT_LT(at(0.4).minus(at(0.4 + 0.2)).norm(), 1e-9);  // 5 turns a second
  // Turns about the axis it blows along.
  const V turn = so3::log(at(0).q.conjugate() * at(0.01).q);
  EXPECT_LT((turn - V(0.01 * 10 * std::numbers::pi, 0, 0)).norm(), 1e-9);
  EXPECT_LT((at(0.033).p - V(1, 2, 3)).norm(), 1e-12);
}

Scene walk_and_drive() {
  Scene scene;
  Walker walker;
  walker.path = kLap;
  add_walker(scene, materials(), walker);
  Car car;
  car.path = kLap;
  add_car(scene, materials(), car);
  return scene;
}

// Second differences of position and rotation approach a limit as steps shrink: no jump in velocity.
TEST(Movers, MoveSmoothly) {
  const Scene scene = walk_and_drive();
  const auto acceleration = [](const MovingPart& part, double t, double h) {
    return Vector6d((part.T_map_part(t + h).minus(part.T_map_part(t)) -
                     part.T_map_part(t).minus(part.T_map_part(t - h))) /
                    (h * h));
  };
  for (const MovingPart& part : scene.moving) {
    for (double t = 0.05; t < 4; t += 0.173) {
      const Vector6d coarse = acceleration(part, t, 2e-3), fine = acceleration(part, t, 1e-3);
      EXPECT_LT((coarse - fine).norm(), 0.02 * (1 + fine.norm())) << part.name << " at " << t;
      EXPECT_TRUE(part.T_map_part(t).matrix().allFinite());
    }
  }
}

TEST(Movers, AWalkerGoesAtItsSpeedAndStandsOnTheFloor) {
  const Scene scene = walk_and_drive();
  double highest = 0;
  for (const MovingPart& part : scene.moving) {
    if (part.name.rfind("person", 0) != 0) continue;
    for (double t = 0; t < 2; t += 0.05) {
      for (const Eigen::Vector3f& v : part.mesh.vertices) {
        const V p = part.T_map_part(t) * v.cast<double>();
        EXPECT_GT(p.z(), -0.08);
        highest = std::max(highest, p.z());
      }
    }
  }
  EXPECT_NEAR(highest, 1.75, 0.1);
  const MovingPart& torso = scene.moving[0];
  double way = 0;
  for (int i = 0; i < 300; ++i)
    way += (torso.T_map_part(0.01 * (i + 1)).p - torso.T_map_part(0.01 * i).p).head<2>().norm();
  EXPECT_NEAR(way, 3 * 1.2, 0.01);
}

TEST(Movers, WheelsRollWithoutSlipping) {
  Scene scene;
  Car car;
  for (int i = 0; i <= 10; ++i) car.path.emplace_back(4 * i, 0, 0);
  car.path.emplace_back(43, 3, 0);
  for (int i = 10; i >= 0; --i) car.path.emplace_back(4 * i, 6, 0);
  car.path.emplace_back(-3, 3, 0);
  car.start_m = 20;
  add_car(scene, materials(), car);
  int wheels = 0;
  for (const MovingPart& part : scene.moving) {
    if (part.name.rfind("car.wheel", 0) != 0) continue;
    ++wheels;
    // On the straight: the point that touches the ground stands still.
    const double t = 0.013, h = 1e-5;
    const Pose before = part.T_map_part(t - h), after = part.T_map_part(t + h), now = part.T_map_part(t);
    const V touching = now.inverse() * V(now.p.x(), now.p.y(), 0);
    EXPECT_LT(((after * touching) - (before * touching)).norm() / (2 * h), 0.05);
    EXPECT_NEAR((after.p - before.p).norm() / (2 * h), 6, 0.05);
  }
  EXPECT_EQ(wheels, 4);
}

TEST(Movers, EachIsAnObjectOfItsOwn) {
  const Scene scene = walk_and_drive();
  std::set<std::int32_t> person, car;
  for (const MovingPart& part : scene.moving) {
    for (const std::int32_t object : part.mesh.object)
      (part.name.rfind("person", 0) == 0 ? person : car).insert(object);
  }
  ASSERT_EQ(person.size(), 1u);
  ASSERT_EQ(car.size(), 1u);
  EXPECT_EQ(scene.objects[static_cast<std::size_t>(*person.begin())], "person");
  EXPECT_EQ(scene.objects[static_cast<std::size_t>(*car.begin())], "car");
}

}  // namespace
}  // namespace evpose::sim
