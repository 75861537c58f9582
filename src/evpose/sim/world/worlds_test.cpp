// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/worlds.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/world/mesh_builder.h"
#include "evpose/sim/world/texture.h"
#include "evpose/sim/world/world_builder.h"

namespace evpose::sim {
namespace {

constexpr WorldKind kKinds[] = {WorldKind::hall, WorldKind::courtyard, WorldKind::canyon};

// The geometry alone: textures take most of the time.
Scene layout(WorldKind kind, int seed, int movers = 0) {
  WorldConfig config;
  config.kind = kind;
  config.seed = seed;
  config.movers.fans = config.movers.people = movers;
  WorldBuilder builder(config);
  EXPECT_TRUE(build_world(builder).ok());
  return std::move(builder.scene);
}

TEST(Worlds, AreTheSameForASeedAndArrangedAnewByAnother) {
  for (const WorldKind kind : kKinds) {
    const Scene a = layout(kind, 4), b = layout(kind, 4), c = layout(kind, 5);
    EXPECT_EQ(a.mesh.vertices, b.mesh.vertices);
    EXPECT_EQ(a.mesh.triangles, b.mesh.triangles);
    EXPECT_NE(a.mesh.vertices, c.mesh.vertices);
    EXPECT_NE(a.mesh.triangles.size(), c.mesh.triangles.size());
  }
}

TEST(Worlds, MeshesAreSound) {
  for (const WorldKind kind : kKinds) {
    const Scene scene = layout(kind, 2, 2);
    const auto check = [&](const Mesh& mesh) {
      ASSERT_EQ(mesh.uv.size(), mesh.triangles.size());
      for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto& t = mesh.triangles[i];
        const Eigen::Vector3f ab = mesh.vertices[t[1]] - mesh.vertices[t[0]],
                              ac = mesh.vertices[t[2]] - mesh.vertices[t[0]];
        ASSERT_GT(ab.cross(ac).norm(), 1e-9F) << "triangle " << i << " of " << scene.name;
        // The texture is as large as the surface.
        const Eigen::Vector2f uv_b = mesh.uv[i][1] - mesh.uv[i][0];
        ASSERT_NEAR(uv_b.norm(), ab.norm(), 0.01 + 0.02 * static_cast<double>(ab.norm()));
        ASSERT_GE(mesh.object[i], 0);
        ASSERT_LT(mesh.object[i], static_cast<std::int32_t>(scene.objects.size()));
        for (const auto& n : mesh.normals[i]) ASSERT_GT(n.cast<double>().dot(triangle_normal(mesh, i)), 0.9);
      }
    };
    check(scene.mesh);
    for (const MovingPart& part : scene.moving) check(part.mesh);
  }
}

TEST(Worlds, LampsGiveTheLightThatIsAskedFor) {
  WorldConfig config;
  config.lamp_lux = 350;
  config.window_cd_m2 = 0;
  WorldBuilder builder(config);
  ASSERT_TRUE(build_world(builder).ok());
  double fill = 0;
  for (const Light& light : builder.scene.lights)
    if (light.kind == LightKind::ambient) fill += light.strength;
  EXPECT_NEAR(lamp_lux_at(builder.scene, {4, 3, 0.75}) + fill, 350, 1);
}

TEST(Worlds, MaterialsReflectPlausibly) {
  WorldConfig config;
  ThreadPool pool(2);
  const auto scene = make_world(config, pool);
  ASSERT_TRUE(scene.ok());
  std::size_t bytes = 0, textured = 0;
  for (const Material& material : scene->materials) {
    EXPECT_GE(material.reflectance, 0);
    if (material.texture == nullptr) continue;
    ++textured;
    bytes += material.texture->bytes();
    const double mean =
        material.reflectance * static_cast<double>(material.texture->mean(1, 1, {2, 0}, {0, 2}));
    EXPECT_GT(mean, 0.02) << material.name;
    EXPECT_LT(mean, 0.9) << material.name;
  }
  EXPECT_GT(textured, 20u);
  EXPECT_LT(bytes, 300u << 20);
}

TEST(Worlds, RepeatedFacadesHaveAllWindowsAlike) {
  for (const WorldKind kind : {WorldKind::courtyard, WorldKind::canyon}) {
    WorldConfig config;
    config.kind = kind;
    config.repeated_facades = true;
    WorldBuilder builder(config);
    ASSERT_TRUE(build_world(builder).ok());
    // Window panes are as large as their opening; all have one size and one place on the texture.
    std::map<std::array<long, 4>, int> panes;
    const Scene& scene = builder.scene;
    ThreadPool pool(1);
    std::set<std::int32_t> glass;
    const auto materials = builder.materials.build(1, pool);
    for (std::size_t i = 0; i < materials.size(); ++i)
      if (materials[i].name == "window panes") glass.insert(static_cast<std::int32_t>(i));
    for (std::size_t i = 0; i < scene.mesh.triangles.size(); i += 2) {
      if (!glass.contains(scene.mesh.material[i])) continue;
      const auto& uv = scene.mesh.uv[i];
      const auto mm = [](float m) { return std::lround(1e3 * static_cast<double>(m)); };
      ++panes[{mm(uv[0].x()), mm(uv[0].y()), mm(uv[1].x()), mm(uv[2].y())}];
    }
    ASSERT_EQ(panes.size(), 1u);
    EXPECT_GT(panes.begin()->second, 60);
  }
}

TEST(Worlds, RefuseCarsInTheHall) {
  WorldConfig config;
  config.movers.cars = 1;
  ThreadPool pool(1);
  const auto scene = make_world(config, pool);
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(scene.error().line(),
            "movers.cars: the hall has no room for cars; take the courtyard or the canyon, or 0 cars");
}

TEST(Worlds, AGlassWallLeavesEverythingElseAsItIs) {
  WorldConfig config;
  WorldBuilder without(config);
  ASSERT_TRUE(build_world(without).ok());
  config.glass_wall = true;
  WorldBuilder with(config);
  ASSERT_TRUE(build_world(with).ok());
  const auto& plain = without.scene.mesh.vertices;
  const auto& glazed = with.scene.mesh.vertices;
  ASSERT_GT(glazed.size(), plain.size());
  EXPECT_TRUE(std::equal(plain.begin(), plain.end(), glazed.begin()));
  EXPECT_TRUE(without.scene.panes.empty());
  EXPECT_EQ(with.scene.panes.size(), 3U);
  config.movers.people = 1;
  EXPECT_FALSE(build_world(with).ok());
  config.movers.people = 0;
  config.kind = WorldKind::canyon;
  EXPECT_FALSE(build_world(with).ok());
}

TEST(Worlds, NightIsMillionsOfTimesDarkerThanDay) {
  WorldConfig day, night;
  day.kind = night.kind = WorldKind::courtyard;
  night.night = true;
  night.lamp_lux = 0;
  WorldBuilder bright(day), dark(night);
  ASSERT_TRUE(build_world(bright).ok());
  ASSERT_TRUE(build_world(dark).ok());
  double in_sun = 0, at_night = 0;
  for (const Light& light : bright.scene.lights) in_sun += light.strength;
  for (const Light& light : dark.scene.lights) at_night += light.kind == LightKind::lamp ? 0 : light.strength;
  EXPECT_GT(in_sun / at_night, 1e5);
  EXPECT_GE(at_night, 0.05);
  EXPECT_LE(at_night, 1.0);
}

TEST(Worlds, ConfigsAreReadAndWritten) {
  WorldConfig config;
  ConfigTable table;
  describe(table, config);
  ASSERT_TRUE(table.set("kind", "canyon", "test").ok());
  ASSERT_TRUE(table.set("movers.cars", "2", "test").ok());
  EXPECT_EQ(config.kind, WorldKind::canyon);
  EXPECT_EQ(config.movers.cars, 2);
  EXPECT_FALSE(table.set("sun_lux", "-1", "test").ok());
}

}  // namespace
}  // namespace evpose::sim
