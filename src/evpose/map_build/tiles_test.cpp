// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
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
  const auto tiles = cut_into_tiles(points, 6000, 1);
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
  constexpr float kFar = std::numeric_limits<float>::infinity();
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
