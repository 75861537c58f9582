// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/moved_furniture.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

#include "evpose/io/files/test_files.h"
#include "evpose/sim/world/world_builder.h"

namespace evpose::sim {
namespace {

Scene layout(WorldKind kind) {
  WorldConfig config;
  config.kind = kind;
  WorldBuilder builder(config);
  EXPECT_TRUE(build_world(builder).ok());
  return std::move(builder.scene);
}

std::map<std::int32_t, Eigen::AlignedBox3f> boxes(const Scene& scene) {
  std::map<std::int32_t, Eigen::AlignedBox3f> all;
  for (std::size_t i = 0; i < scene.mesh.triangles.size(); ++i)
    for (const auto v : scene.mesh.triangles[i]) all[scene.mesh.object[i]].extend(scene.mesh.vertices[v]);
  return all;
}

TEST(MovedFurniture, SomePiecesStandElsewhereOnTheFloorAndNothingElseDoes) {
  for (const WorldKind kind : {WorldKind::hall, WorldKind::courtyard, WorldKind::canyon}) {
    const Scene scene = layout(kind);
    ASSERT_GE(scene.furniture.size(), 8u);
    const auto moved = with_moved_furniture(scene, 4, 1);
    ASSERT_TRUE(moved.ok()) << error_line(moved);
    const auto before = boxes(scene), after = boxes(*moved);
    int count = 0;
    for (const auto& [object, box] : before) {
      const Eigen::Vector3f shift = after.at(object).center() - box.center();
      if (shift.norm() < 1e-6F) continue;
      ++count;
      EXPECT_TRUE(std::find(scene.furniture.begin(), scene.furniture.end(), object) != scene.furniture.end());
      EXPECT_NEAR(shift.z(), 0, 1e-5);
      // Turning about the middle shifts the middle of the upright box by little.
      EXPECT_GT(shift.norm(), 0.03F);
      EXPECT_LT(shift.norm(), 0.55F);
    }
    EXPECT_EQ(count, 4) << scene.name;
    EXPECT_EQ(moved->mesh.triangles, scene.mesh.triangles);
  }
}

TEST(MovedFurniture, DoesNotEnterWhatStandsThere) {
  const Scene scene = layout(WorldKind::hall);
  const auto moved = with_moved_furniture(scene, 6, 2);
  ASSERT_TRUE(moved.ok()) << error_line(moved);
  for (const auto& [object, box] : boxes(*moved)) {
    if (std::find(scene.furniture.begin(), scene.furniture.end(), object) == scene.furniture.end()) continue;
    EXPECT_GT(box.min().x(), -0.011F);
    EXPECT_GT(box.min().y(), -0.011F);
    EXPECT_LT(box.max().x(), 8.011F);
    EXPECT_LT(box.max().y(), 6.011F);
  }
}

TEST(MovedFurniture, TheSeedSelectsAndTooManyAreRefused) {
  const Scene scene = layout(WorldKind::hall);
  const auto a = with_moved_furniture(scene, 3, 1), b = with_moved_furniture(scene, 3, 1),
             c = with_moved_furniture(scene, 3, 2);
  ASSERT_TRUE(a.ok() && b.ok() && c.ok());
  EXPECT_EQ(a->mesh.vertices, b->mesh.vertices);
  EXPECT_NE(a->mesh.vertices, c->mesh.vertices);
  EXPECT_TRUE(says(error_line(with_moved_furniture(scene, 1000, 1)), {"lidar.moved_furniture", "1000"}));
}

}  // namespace
}  // namespace evpose::sim
