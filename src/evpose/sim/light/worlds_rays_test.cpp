// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "evpose/sim/light/ray_caster.h"
#include "evpose/sim/world/mesh_builder.h"
#include "evpose/sim/world/random.h"
#include "evpose/sim/world/world_builder.h"
#include "evpose/sim/world/worlds.h"

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;
constexpr WorldKind kKinds[] = {WorldKind::hall, WorldKind::courtyard, WorldKind::canyon};

// The geometry alone: textures take most of the time.
Scene layout(WorldKind kind, int seed) {
  WorldConfig config;
  config.kind = kind;
  config.seed = seed;
  WorldBuilder builder(config);
  EXPECT_TRUE(build_world(builder).ok());
  return std::move(builder.scene);
}

// No ray that stays within the free space meets anything.
TEST(WorldsRays, TheFreeSpaceIsFree) {
  for (const WorldKind kind : kKinds) {
    if (kind == WorldKind::courtyard) continue;
    for (const int seed : {1, 2, 3}) {
      const Scene scene = layout(kind, seed);
      const RayCaster rays(scene);
      Random random(7);
      for (int i = 0; i < 3000; ++i) {
        V ends[2];
        for (V& end : ends)
          for (int k = 0; k < 3; ++k) end[k] = random.uniform(scene.low[k], scene.high[k]);
        ASSERT_FALSE(rays.occluded(ends[0], ends[1] - ends[0], 0, 1)) << scene.name << ", seed " << seed;
      }
    }
  }
}

TEST(WorldsRays, TheConeOverTheLandingPadIsFree) {
  for (const int seed : {1, 2, 3, 4}) {
    const Scene scene = layout(WorldKind::courtyard, seed);
    const RayCaster rays(scene);
    Random random(8);
    for (int i = 0; i < 3000; ++i) {
      V ends[2];
      for (V& end : ends) {
        end.z() = random.uniform(0.31, 7);
        const double radius = (0.75 + end.z() - 0.3) * std::sqrt(random.uniform()),
                     angle = random.uniform(0, 6.2831);
        end.head<2>() = radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      }
      ASSERT_FALSE(rays.occluded(ends[0], ends[1] - ends[0], 0, 1)) << "seed " << seed;
    }
    // The pad: 1.5 m wide, its top at 0.3.
    for (const double x : {-0.74, 0.0, 0.74}) {
      const auto hit = rays.trace({x, 0, 2}, {0, 0, -1});
      ASSERT_TRUE(hit);
      EXPECT_NEAR(hit->distance, 1.7, 1e-5);
    }
    EXPECT_NEAR(rays.trace({0.76, 0, 2}, {0, 0, -1})->distance, 2, 1e-5);
  }
}

// What one ray at a time finds among static and moving surfaces is what batches find, part by part.
TEST(WorldsRays, BatchesOfMovingPartsAreSingleRays) {
  WorldConfig config;
  config.seed = 2;
  config.movers.people = 4;
  WorldBuilder builder(config);
  ASSERT_TRUE(build_world(builder).ok());
  const RayCaster rays(builder.scene);
  const std::vector<Pose> parts = rays.parts_at(1.3);
  const V eye = 0.5 * (builder.scene.low + builder.scene.high);
  Random random(11);
  std::vector<Eigen::Vector3f> ways;
  for (int i = 0; i < 20003; ++i)
    ways.emplace_back(Eigen::Vector3d(random.normal(), random.normal(), 0.3 * random.normal()).cast<float>());
  std::vector<RayCaster::BatchHit> nearest(ways.size()), own(ways.size());
  rays.trace_batch(eye, ways, nearest);
  std::vector<int> of(ways.size(), -1);
  for (std::size_t part = 0; part < parts.size(); ++part) {
    const Pose T_part_map = parts[part].inverse();
    std::vector<Eigen::Vector3f> turned;
    for (const Eigen::Vector3f& way : ways)
      turned.emplace_back((T_part_map.q * way.cast<double>()).cast<float>());
    rays.trace_part_batch(static_cast<int>(part), T_part_map * eye, turned, own);
    for (std::size_t i = 0; i < ways.size(); ++i)
      if (own[i].triangle != RayCaster::kNoTriangle && own[i].distance < nearest[i].distance)
        nearest[i] = own[i], of[i] = static_cast<int>(part);
  }
  int moving = 0;
  for (std::size_t i = 0; i < ways.size(); ++i) {
    const auto hit = rays.trace(parts, eye, ways[i].cast<double>());
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->part, of[i]) << i;
    EXPECT_EQ(hit->triangle, nearest[i].triangle) << i;
    EXPECT_FLOAT_EQ(hit->distance, nearest[i].distance) << i;
    moving += hit->part >= 0;
  }
  EXPECT_GT(moving, 100);
}

// No ray from the free space hits a back face: bodies are closed where they are visible.
TEST(WorldsRays, OnlyFrontsAreSeen) {
  for (const WorldKind kind : kKinds) {
    const Scene scene = layout(kind, 3);
    const RayCaster rays(scene);
    Random random(9);
    int backs = 0, seen = 0;
    for (int i = 0; i < 20000; ++i) {
      V from, way;
      for (int k = 0; k < 3; ++k) {
        from[k] = random.uniform(scene.low[k], scene.high[k]);
        way[k] = random.normal();
      }
      if (kind == WorldKind::courtyard) from = V(0, 0, 3);
      const auto hit = rays.trace(from, way);
      if (!hit) continue;
      ++seen;
      if (triangle_normal(scene.mesh, hit->triangle).dot(way) > 0) ++backs;
    }
    EXPECT_GT(seen, 5000);
    EXPECT_LT(backs, seen / 2000) << scene.name;
  }
}

// The rim of every pane of the hall is in its frame: nobody sees it from where cameras fly. Nothing but bars
// cuts through a pane: within it, a line of sight is free from frame to frame.
TEST(WorldsRays, PanesFillTheirFrames) {
  for (const int seed : {1, 2, 3, 4}) {
    WorldConfig config;
    config.seed = seed;
    config.glass_wall = true;
    WorldBuilder builder(config);
    ASSERT_TRUE(build_world(builder).ok());
    const Scene& scene = builder.scene;
    const RayCaster rays(scene);
    Random random(9);
    ASSERT_EQ(scene.panes.size(), 3U);
    for (std::size_t k = 0; k < scene.panes.size(); ++k) {
      const Pane& pane = scene.panes[k];
      for (int i = 0; i < 1000; ++i) {
        const double part = random.uniform(0, 1), end = i % 2;
        const V rim =
            pane.corner + (i % 4 < 2 ? V(part * pane.u + end * pane.v) : V(end * pane.u + part * pane.v));
        V eye;
        for (int j = 0; j < 3; ++j) eye[j] = random.uniform(scene.low[j], scene.high[j]);
        ASSERT_TRUE(rays.occluded(eye, rim - eye, 0, 0.9999F)) << rim.transpose();
      }
      if (k == 2) continue;  // the window has bars
      for (double part = 0.02; part < 0.98; part += 0.01) {
        const V across = pane.corner + part * pane.v, up = pane.corner + part * pane.u;
        ASSERT_FALSE(rays.occluded(across, pane.u, 0.02F, 0.98F)) << across.transpose();
        ASSERT_FALSE(rays.occluded(up, pane.v, 0.02F, 0.98F)) << up.transpose();
      }
    }
  }
}

}  // namespace
}  // namespace evpose::sim
