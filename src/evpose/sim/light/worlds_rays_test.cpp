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
