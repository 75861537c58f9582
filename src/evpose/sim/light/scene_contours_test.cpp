// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/scene_contours.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <set>

#include "evpose/core/parallel.h"
#include "evpose/sim/world/mesh_builder.h"

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;

// A floor of 20 x 20 m at z = 0, seen from all around above.
Scene floor_scene() {
  Scene scene;
  scene.low = {-5, -5, 0.5};
  scene.high = {5, 5, 4};
  add_face(scene.mesh, {V(-10, -10, 0), V(20, 0, 0), V(0, 20, 0)}, {});
  return scene;
}
constexpr double kFloorRim = 80;

ContourMap contours(const Scene& scene, double spacing_m = 0.01, int threads = 1) {
  ThreadPool pool(threads);
  return make_contours(scene, RayCaster(scene), spacing_m, pool);
}

double length(const ContourMap& map, ContourKind kind) {
  double sum = 0;
  for (const ContourPoint& p : map.points)
    if (p.kind == kind) sum += static_cast<double>(p.length);
  return sum;
}
double all(const ContourMap& map) {
  return length(map, ContourKind::crease) + length(map, ContourKind::boundary);
}

// What every contour point promises.
void expect_sound(const ContourMap& map) {
  for (const ContourPoint& p : map.points) {
    EXPECT_NEAR(p.tangent.norm(), 1, 1e-5);
    EXPECT_NEAR(p.normal.norm(), 1, 1e-5);
    EXPECT_NEAR(p.normal.dot(p.tangent), 0, 1e-4);
    EXPECT_GE(p.contour, 0);
    EXPECT_GE(p.plane_a, 0);
    EXPECT_EQ(p.plane_b >= 0, p.kind == ContourKind::crease);
  }
}

TEST(SceneContours, TheRimOfASheetIsABoundary) {
  const ContourMap map = contours(floor_scene());
  EXPECT_NEAR(length(map, ContourKind::boundary), kFloorRim, 1e-3);
  EXPECT_EQ(length(map, ContourKind::crease), 0);
  for (const ContourPoint& p : map.points)
    EXPECT_GT(p.normal.dot(p.position.normalized()), 0.6F);  // outwards
  expect_sound(map);
}

// With and without the face that nobody sees.
TEST(SceneContours, ABoxOnTheFloorHasTwelveEdges) {
  for (const unsigned sides : {63u, 63u & ~static_cast<unsigned>(side_below)}) {
    Scene scene = floor_scene();
    add_box_on(scene.mesh, {0.3, -0.4, 0}, {1, 1.5, 0.8}, 0.3, {}, sides);
    const ContourMap map = contours(scene);
    EXPECT_NEAR(length(map, ContourKind::crease), 4 * (1 + 1.5 + 0.8), 1e-3);
    EXPECT_NEAR(length(map, ContourKind::boundary), kFloorRim, 1e-3);
    expect_sound(map);
  }
}

TEST(SceneContours, ABoxInTheAirIsSeenFromAllSides) {
  Scene scene = floor_scene();
  add_box(scene.mesh, {so3::exp({0.2, 0.1, 0.4}), {0, 0, 2}}, {0.5, 0.6, 0.7}, {});
  const ContourMap map = contours(scene);
  EXPECT_NEAR(length(map, ContourKind::crease), 4 * 1.8, 1e-3);
  // Normals lie in face a and point away from it: against the middle of the box, from there outwards.
  for (const ContourPoint& p : map.points) {
    if (p.kind != ContourKind::crease) continue;
    EXPECT_GT(p.normal.dot(p.position - Eigen::Vector3f(0, 0, 2)), 0.2F);
  }
}

TEST(SceneContours, BoxesAgainstEachOtherHaveACreaseBetweenAndNoBuriedEdge) {
  Scene scene = floor_scene();
  // The smaller one leans on the middle of the larger one's side.
  add_box_between(scene.mesh, {0, -1, 0}, {1, 1, 1}, {});
  add_box_between(scene.mesh, {1, -0.5, 0}, {1.5, 0.5, 0.6}, {});
  const ContourMap map = contours(scene);
  // Large one without the stretch of floor line that is covered; small one with the four lines against the
  // large one, less that on the floor.
  const double large = 4 * (1 + 2 + 1) - 1, small = 4 * (0.5 + 1 + 0.6) - 1;
  EXPECT_NEAR(length(map, ContourKind::crease), large + small, 0.025);
}

TEST(SceneContours, BoxesInLineHaveNoSeam) {
  Scene one = floor_scene(), two = floor_scene();
  add_box_between(one.mesh, {0, 0, 0}, {2, 0.5, 0.5}, {});
  add_box_between(two.mesh, {0, 0, 0}, {1, 0.5, 0.5}, {});
  add_box_between(two.mesh, {1, 0, 0}, {2, 0.5, 0.5}, {});
  EXPECT_NEAR(all(contours(one)), all(contours(two)), 0.025);
}

TEST(SceneContours, WhatIsPrintedIsNoContour) {
  Scene plain = floor_scene(), printed = floor_scene();
  for (Scene* s : {&plain, &printed}) add_box_between(s->mesh, {0, 0, 0}, {1, 1, 1}, {});
  add_print(printed.mesh, {V(0, 0, 0), V(1, 0, 0), V(0, 0, 1)}, {0.2, 0.7, 0.3, 0.8}, {});
  add_print(printed.mesh, {V(-3, -3, 0), V(2, 0, 0), V(0, 2, 0)}, {0, 2, 0, 2}, {});
  EXPECT_NEAR(all(contours(plain)), all(contours(printed)), 1e-3);
}

TEST(SceneContours, AWallWithAWindow) {
  Scene scene;
  scene.low = {-2, -4, 0.5};
  scene.high = {2, -1, 2.5};
  add_wall(scene.mesh, {V(-5, 0, 0), V(10, 0, 0), V(0, 0, 3)}, {{4, 6, 1, 2}}, 0.2, {}, {});
  const ContourMap map = contours(scene);
  // Window: the rim in the wall and four lines into the depth; the rim behind is where sheets end.
  EXPECT_NEAR(length(map, ContourKind::crease), 6 + 4 * 0.2, 1e-3);
  EXPECT_NEAR(length(map, ContourKind::boundary), 26 + 6, 1e-3);
}

TEST(SceneContours, ARoundPostHasNoUprightLines) {
  Scene scene = floor_scene();
  Cylinder post;
  post.radius_below = post.radius_above = 0.4;
  post.height = 1.5;
  post.facets = 24;
  post.lid_below = false;
  add_cylinder(scene.mesh, {}, post, {});
  const ContourMap map = contours(scene);
  const double ring = 24 * 2 * 0.4 * std::sin(std::numbers::pi / 24);
  EXPECT_NEAR(length(map, ContourKind::crease), 2 * ring, 1e-3);
  std::set<std::int32_t> numbers;
  for (const ContourPoint& p : map.points)
    if (p.kind == ContourKind::crease) numbers.insert(p.contour);
  EXPECT_EQ(numbers.size(), 2u);
}

TEST(SceneContours, WhatCannotBeSeenFromTheFreeSpaceIsLeftOut) {
  Scene scene = floor_scene();
  add_box_between(scene.mesh, {0, 0, 0}, {1, 1, 1}, {});
  add_box_between(scene.mesh, {0.3, 0.3, 0.3}, {0.7, 0.7, 0.7}, {});  // inside the other
  add_box_between(scene.mesh, {0, 0, -3}, {1, 1, -2}, {});            // below the floor
  EXPECT_NEAR(length(contours(scene), ContourKind::crease), 12, 1e-3);
}

TEST(SceneContours, AreTheSameForAnyNumberOfThreads) {
  Scene scene = floor_scene();
  for (int i = 0; i < 6; ++i)
    add_box_on(scene.mesh, {i - 3.0, 0.3 * i, 0}, {0.5, 0.4, 0.3 + 0.1 * i}, 0.5 * i, {});
  const ContourMap one = contours(scene, 0.02, 1), three = contours(scene, 0.02, 3);
  ASSERT_EQ(one.points.size(), three.points.size());
  for (std::size_t i = 0; i < one.points.size(); ++i) {
    EXPECT_EQ(one.points[i].position, three.points[i].position);
    EXPECT_EQ(one.points[i].contour, three.points[i].contour);
    EXPECT_EQ(one.points[i].plane_a, three.points[i].plane_a);
  }
}

}  // namespace
}  // namespace evpose::sim
