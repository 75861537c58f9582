// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "evpose/map_build/test_scan.h"
#include "evpose/map_build/tiles.h"

namespace evpose::map_build {
namespace {

TEST(Tiles, EachPointIsHeldByOneAndNoTileIsTooLarge) {
  std::mt19937 random(28);
  std::uniform_real_distribution<float> across(0, 60), along(0, 25);
  std::vector<Eigen::Vector3f> points(20000);
  for (auto& p : points) p = {across(random), along(random), 0};
  const auto tiles = cut_into_tiles(points, points.size(), 6000, 1);
  EXPECT_EQ(tiles.size(), 4U);
  std::vector<std::size_t> held(tiles.size(), 0);
  for (const auto& p : points) {
    int holders = 0;
    for (std::size_t k = 0; k < tiles.size(); ++k)
      if (tiles[k].holds(p)) ++holders, ++held[k];
    EXPECT_EQ(holders, 1);
  }
  for (const std::size_t count : held) EXPECT_LT(count, 6600U);
}

TEST(Tiles, AClippedSegmentLiesInItsCore) {
  constexpr float kFar = CloudTile::kNoBorder_m;
  LineSegment segment;
  segment.begin = {0, 0, 0};
  segment.end = {4, 2, 1};
  const auto half = clipped(segment, {{1, -kFar}, {3, kFar}, 0.5F});
  ASSERT_TRUE(half);
  EXPECT_TRUE(half->begin.isApprox(Eigen::Vector3d(1, 0.5, 0.25)));
  EXPECT_TRUE(half->end.isApprox(Eigen::Vector3d(3, 1.5, 0.75)));
  EXPECT_FALSE(clipped(segment, {{5, -kFar}, {kFar, kFar}, 0.5F}));
}

TEST(Tiles, ACreaseAcrossTilesIsWholeAndStraight) {
  Scan scan(29);  // a kerb of 30 m along x
  scan.rectangle({0, 0, 0}, {30, 0, 0}, {0, 0.6, 0}, 1600)
      .rectangle({0, 0, 0}, {30, 0, 0}, {0, 0, 0.5}, 1600);
  BuildConfig config;
  config.tile_points = 20'000;
  ThreadPool pool(2);
  const auto built = build_map(scan.cloud(), config, pool, [](double) { return true; });
  ASSERT_TRUE(built) << built.error().line();
  EXPECT_GT(built->figures.tiles, 1U);
  double length = 0;
  for (std::size_t i = 0; i < built->map.points.size(); ++i) {
    const ContourPoint& p = built->map.points[i];
    if (p.kind != ContourKind::crease || std::abs(p.tangent.x()) < 0.9F) continue;
    EXPECT_LT(built->map.position(i).tail<2>().norm(), 0.005);
    length += static_cast<double>(p.length);
  }
  EXPECT_NEAR(length, 30, 0.3);
}

/// What one is compared by: everything that a map's file holds.
void expect_same_map(const ContourMap& a, const ContourMap& b) {
  ASSERT_EQ(a.points.size(), b.points.size());
  ASSERT_EQ(a.polygons.size(), b.polygons.size());
  ASSERT_EQ(a.planes.size(), b.planes.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_EQ(a.points[i].position, b.points[i].position);
    EXPECT_EQ(a.points[i].contour, b.points[i].contour);
    EXPECT_EQ(a.points[i].plane_a, b.points[i].plane_a);
    EXPECT_EQ(a.points[i].plane_b, b.points[i].plane_b);
  }
  for (std::size_t i = 0; i < a.polygons.size(); ++i) {
    EXPECT_EQ(a.polygons[i].vertices, b.polygons[i].vertices);
    EXPECT_EQ(a.polygons[i].plane, b.polygons[i].plane);
    EXPECT_EQ(a.polygons[i].hole_of, b.polygons[i].hole_of);
  }
  for (std::size_t i = 0; i < a.planes.size(); ++i) EXPECT_EQ(a.planes[i].d, b.planes[i].d);
}

TEST(Tiles, BuiltByThemselvesTheyMakeTheMapOfOneRun) {
  Scan scan(32);
  scan.rectangle({0, 0, 0}, {20, 0, 0}, {0, 4, 0}, 1600).rectangle({0, 4, 0}, {20, 0, 0}, {0, 0, 3}, 1600);
  const PointCloud cloud = scan.cloud();
  BuildConfig config;
  config.tile_points = 60'000;
  ThreadPool pool(2);
  const auto whole = build_map(cloud, config, pool, [](double) { return true; });
  ASSERT_TRUE(whole) << whole.error().line();
  const auto tiles =
      cut_into_tiles(cloud.points, cloud.points.size(), config.tile_points, config.tile_overlap_m);
  ASSERT_GT(tiles.size(), 2U);
  ContourMap merged;
  merged.anchor = cloud.anchor;
  for (const CloudTile& tile : tiles) {
    const auto part =
        build_tile(points_seen_by(cloud, tile), tile, config, pool, [](double) { return true; });
    ASSERT_TRUE(part) << part.error().line();
    append_tile(part->map, merged);
  }
  ASSERT_TRUE(complete_map(merged));
  expect_same_map(whole->map, merged);
  EXPECT_EQ(whole->map.occluders.vertices, merged.occluders.vertices);
}

TEST(Tiles, OrderOfThePointsDoesNotMatterAndDuplicatesGo) {
  PointCloud one = room_corner(30), other = one;
  std::mt19937 random(31);
  other.points.insert(other.points.end(), one.points.begin(), one.points.begin() + 100);
  std::shuffle(other.points.begin(), other.points.end(), random);
  EXPECT_EQ(sort_and_deduplicate(one), 0U);
  EXPECT_EQ(sort_and_deduplicate(other), 100U);
  EXPECT_EQ(one.points, other.points);
}

}  // namespace
}  // namespace evpose::map_build
