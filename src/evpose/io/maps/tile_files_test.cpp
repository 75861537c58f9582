// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>

#include "evpose/io/files/test_files.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/ply.h"
#include "evpose/io/maps/tile_files.h"

namespace evpose {
namespace {

std::vector<CloudPoint> random_points(std::size_t count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> place(-50, 50);
  std::vector<CloudPoint> points(count);
  for (auto& p : points) {
    p.position = {place(random), place(random) + 1000, place(random)};
    p.intensity = static_cast<std::uint8_t>(random() % 256);
  }
  return points;
}

TEST(TileFiles, EachTileHasThePointsThatItSeesAsTheCloudHasThem) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_ply_cloud(folder / "a.ply", random_points(100'000)));
  const auto cloud = read_cloud(folder / "a.ply");
  ASSERT_TRUE(cloud);
  const CloudTile left{{-1e30F, -1e30F}, {3, 1e30F}, 2}, right{{3, -1e30F}, {1e30F, 1e30F}, 2};
  const auto survey = survey_cloud(folder / "a.ply");
  ASSERT_TRUE(survey);
  auto writer = TileCloudWriter::create({folder / "tiles", "it's a.ply", survey->anchor, {left, right}, {}},
                                        true, "noise: 0.01\n");
  ASSERT_TRUE(writer) << error_line(writer);
  ASSERT_TRUE(visit_cloud(*survey, [&](const PointCloud& block) { return writer->add(block); }));
  ASSERT_TRUE(writer->commit());
  const auto plan = read_tile_plan(folder / "tiles");
  ASSERT_TRUE(plan) << error_line(plan);
  EXPECT_EQ(plan->cloud, "it's a.ply");
  EXPECT_EQ(plan->anchor, cloud->anchor);
  ASSERT_EQ(plan->tiles.size(), 2U);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(plan->tiles[k].low, (k == 0 ? left : right).low);
    const auto part = read_tile_cloud(*plan, k);
    ASSERT_TRUE(part) << error_line(part);
    std::vector<Eigen::Vector3f> points;
    std::vector<std::uint8_t> brightness;
    for (std::size_t i = 0; i < cloud->points.size(); ++i)
      if (plan->tiles[k].holds(cloud->points[i], 2)) {
        points.push_back(cloud->points[i]);
        brightness.push_back(cloud->brightness[i]);
      }
    EXPECT_EQ(part->points, points);
    EXPECT_EQ(part->brightness, brightness);
  }
}

TEST(TileFiles, ErrorsNameWhatIsWrong) {
  const TemporaryFolder folder;
  EXPECT_TRUE(says(error_line(read_tile_plan(folder / "none")), {"none", "no folder of tiles", "--plan"}));
  const CloudTile all{{-1e30F, -1e30F}, {1e30F, 1e30F}, 1};
  const auto create = [&] {
    return TileCloudWriter::create({folder / "tiles", "a.ply", Eigen::Vector3d::Zero(), {all}, {}}, false,
                                   "");
  };
  {
    auto writer = create();
    ASSERT_TRUE(writer);
    PointCloud block;
    block.points = {{1, 2, 3}, {4, 5, 6}};
    ASSERT_TRUE(writer->add(block));
    ASSERT_TRUE(writer->commit());
  }
  EXPECT_TRUE(says(error_line(create()), {"tiles", "already"}));
  auto plan = read_tile_plan(folder / "tiles");
  ASSERT_TRUE(plan);
  EXPECT_EQ(read_tile_cloud(*plan, 0)->points.size(), 2U);
  plan->points[0] = 3;
  EXPECT_TRUE(says(error_line(read_tile_cloud(*plan, 0)), {"tile_0.ply", "2 points", "3"}));
  for (const char* content :
       {"format: other\n", "format: evpose-tiles\nversion: 1\ncloud: a\n",
        "format: evpose-tiles\nversion: 1\ncloud: a\nanchor: [0, 0, 0]\ntiles: [[0, 0]]\n",
        "format: evpose-tiles\nversion: 1\ncloud: a\nanchor: [0, 0, 0]\ntiles: []\n"}) {
    folder.file("tiles/plan.yaml", content);
    EXPECT_TRUE(says(error_line(read_tile_plan(folder / "tiles")), {"plan.yaml"})) << content;
  }
}

TEST(TileFiles, AnInterruptedPlanLeavesNothing) {
  const TemporaryFolder folder;
  {
    const CloudTile all{{-1e30F, -1e30F}, {1e30F, 1e30F}, 1};
    auto writer =
        TileCloudWriter::create({folder / "tiles", "a.ply", Eigen::Vector3d::Zero(), {all}, {}}, false, "");
    ASSERT_TRUE(writer);
  }
  EXPECT_EQ(folder.entries(), 0U);
}

TEST(MapH5, AMapWrittenAndReadIsWrittenTheSame) {
  const TemporaryFolder folder;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-5, 5);
  ContourMap map;
  map.source = "a.ply";
  map.planes.push_back({Eigen::Vector3f::UnitZ(), 0.1, 30, 0.01F});
  map.polygons.push_back({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 0, -1});
  for (std::int32_t k = 0; k < 200; ++k) {
    ContourPoint p;
    p.position = {place(random), place(random), place(random)};
    p.tangent = Eigen::Vector3f::UnitX();
    p.length = 0.02F + 1e-3F * place(random);
    p.sigma = 1e-3F;
    p.contour = k / 7;
    p.kind = k / 7 % 2 == 0 ? ContourKind::crease : ContourKind::boundary;
    map.points.push_back(p);
  }
  ASSERT_TRUE(write_map_h5(folder / "a.h5", map));
  auto again = read_map_h5(folder / "a.h5");
  ASSERT_TRUE(again) << error_line(again);
  again->source = "a.ply";
  ASSERT_TRUE(write_map_h5(folder / "b.h5", *again));
  EXPECT_EQ(content_of(folder / "a.h5"), content_of(folder / "b.h5"));
}

}  // namespace
}  // namespace evpose
