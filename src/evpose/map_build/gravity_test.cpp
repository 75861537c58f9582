// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "evpose/map_build/gravity.h"
#include "evpose/map_build/test_scan.h"

namespace evpose::map_build {
namespace {

TEST(Gravity, ATiltedRoomIsLevelledByItsFloorAndWalls) {
  const Eigen::AngleAxisd tilt(0.047, Eigen::Vector3d(1, 2, 0).normalized());
  PointCloud cloud = room_corner(12);
  for (auto& p : cloud.points) p = (tilt * p.cast<double>()).cast<float>();
  auto built = build(cloud);
  ASSERT_TRUE(built);
  const UpDirection up = find_up(built->map);
  ASSERT_TRUE(up.known);
  EXPECT_LT((up.up - tilt * Eigen::Vector3d::UnitZ()).norm(), 0.002);
  EXPECT_NEAR(up.tilt_rad, 0.047, 0.002);
  level(built->map, up.up);
  EXPECT_LT(find_up(built->map).tilt_rad, 1e-4);
  for (const auto& plane : built->map.planes) {
    const auto upright = static_cast<double>(std::abs(plane.normal.z()));
    EXPECT_LT(std::min(upright, 1 - upright), 0.01);
  }
}

TEST(Gravity, ASlopingCeilingDoesNotTiltTheFloor) {
  ContourMap map;
  const Eigen::Vector3f floor = Eigen::Vector3f(-0.046F, 0.007F, 1).normalized();
  map.planes.push_back({floor, 0, 50'000, 0.01F});
  map.planes.push_back(
      {Eigen::Vector3f(0.007F, 0.005F, 1).normalized(), 0, 15'000, 0.01F});  // 3 degrees off it
  map.planes.push_back({floor.cross(Eigen::Vector3f::UnitX()).normalized(), 0, 5000, 0.01F});
  const UpDirection up = find_up(map);
  ASSERT_TRUE(up.known);
  EXPECT_LT((up.up - floor.cast<double>()).norm(), 0.002);
}

TEST(Gravity, WallsOfOneDirectionLeaveItUnknown) {
  ContourMap map;
  map.planes.push_back({Eigen::Vector3f::UnitX(), 0, 1000, 0.01F});
  EXPECT_FALSE(find_up(map).known);
  map.planes.push_back({Eigen::Vector3f::UnitY(), 0, 1000, 0.01F});
  EXPECT_TRUE(find_up(map).known);
}

}  // namespace
}  // namespace evpose::map_build
