// SPDX-License-Identifier: BSD-3-Clause
// Clouds of depth cameras, and the maps of them.
#include <gtest/gtest.h>

#include "evpose/map_build/depth_steps.h"
#include "evpose/map_build/median.h"
#include "evpose/map_build/test_depth.h"
#include "evpose/map_build/test_scan.h"

namespace evpose::map_build {
namespace {

/// Of a single image whose depth is rounded to `step_per_m` z^2, as a disparity to a part of a pixel makes
/// it.
PointCloud rounded_cloud(DepthScene& scene, const Pose& T_map_cam, double step_per_m) {
  constexpr double kUnit_m = 0.0001;
  PointCloud cloud;
  const auto depth = scene.image(T_map_cam, kUnit_m, [](double) { return 0.0; });
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (depth[i] == 0) continue;
    const double inverse = std::round(1 / (kUnit_m * depth[i]) / step_per_m) * step_per_m;
    cloud.points.push_back((T_map_cam * (scene.rays()[i].cast<double>() / inverse)).cast<float>());
  }
  cloud.viewpoints.push_back(T_map_cam.p);
  return cloud;
}

/// Lengths of the creases beside the axes x, y and z, and how far they are from these at most. Where the
/// images end, surfaces end as well, and may be given an edge there: that is not looked at.
struct AxisCreases {
  Eigen::Vector3d length_m = Eigen::Vector3d::Zero();
  double worst_m = 0;
};

AxisCreases creases_of(const ContourMap& map) {
  constexpr double kBeside_m = 0.1, kAlong = 0.9;
  AxisCreases out;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const ContourPoint& p = map.points[i];
    if (p.kind != ContourKind::crease) continue;
    Eigen::Index axis = 0;
    if (p.tangent.cwiseAbs().maxCoeff(&axis) < kAlong) continue;
    Eigen::Vector3d off = map.position(i);
    off[axis] = 0;
    if (off.norm() > kBeside_m) continue;
    out.length_m[axis] += static_cast<double>(p.length);
    out.worst_m = std::max(out.worst_m, off.norm());
  }
  return out;
}

TEST(DepthMap, ARoomCornerSeenFromSeveralPlacesHasItsThreeCreases) {
  DepthScene scene = depth_corner(5);
  const DepthFusionConfig config;
  DepthFusion fusion(config);
  for (const Pose& pose : poses_before_corner(12))
    ASSERT_TRUE(fusion.add(scene.samples(pose, config), pose).ok());
  ThreadPool pool(2);
  const auto built = build(cloud_of(fusion.points(pool)), 2);
  ASSERT_TRUE(built.ok()) << built.error().line();
  const AxisCreases creases = creases_of(built->map);
  EXPECT_GT(creases.length_m.minCoeff(), 0.8) << creases.length_m.transpose();
  EXPECT_LT(creases.worst_m, 0.004);
}

/// From 2.2 and 4.4 m, where one image errs nearly four times as much as from the nearer places.
PointCloud corner_from_near_and_far() {
  DepthScene scene = depth_corner(6);
  const DepthFusionConfig config;
  DepthFusion fusion(config);
  for (const Pose& near : poses_before_corner(12))
    for (const double farther : {1.0, 2.0}) {
      const Pose at{near.q, farther * near.p - (farther - 1) * Eigen::Vector3d(0.3, 0.3, 0.4)};
      EXPECT_TRUE(fusion.add(scene.samples(at, config), at).ok());
    }
  ThreadPool pool(2);
  return cloud_of(fusion.points(pool));
}

double median_error_m(const PointCloud& cloud) {
  std::vector<double> off;
  for (const auto& p : cloud.points) off.push_back(static_cast<double>(p.cwiseAbs().minCoeff()));
  return median(off);
}

TEST(DepthMap, WhatIsSeenFromNearIsNotSpoiltFromAfar) {
  const PointCloud cloud = corner_from_near_and_far();
  // With a point for each voxel, the noise of the far images stands before and behind the surfaces.
  EXPECT_LT(median_error_m(cloud), 0.003);
  const auto built = build(cloud, 2);
  ASSERT_TRUE(built.ok()) << built.error().line();
  const AxisCreases creases = creases_of(built->map);
  EXPECT_GT(creases.length_m.minCoeff(), 0.8) << creases.length_m.transpose();
  EXPECT_LT(creases.worst_m, 0.008);
}

TEST(DepthSteps, OfAQuantisedPlaneAreItsLeastNoise) {
  for (const double step_m : {0.02, 0.03}) {
    Scan scan(11);
    PointCloud cloud;
    for (const auto& p : scan.rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0}, 10000).cloud().points) {
      const double height = 0.35 * static_cast<double>(p.x());  // 19 deg from the layers
      cloud.points.emplace_back(p.x(), p.y(), static_cast<float>(step_m * std::round(height / step_m)));
    }
    const auto scale = measure_scale(cloud.points, Neighbours(cloud.points), {}, "cloud");
    ASSERT_TRUE(scale.ok());
    EXPECT_NEAR(scale->noise_m, step_m / std::sqrt(12.0), 0.1 * step_m / std::sqrt(12.0));
    EXPECT_TRUE(scale->layered());
    EXPECT_EQ(find_planes(described(cloud.points), {}).planes.size(), 1U) << step_m;
  }
}

TEST(DepthSteps, GrowWithTheSquareOfRange) {
  DepthScene scene(12);
  scene.rectangle({-4, 0, 0}, {8, 0, 0}, {0, 8, 0});
  const Pose T_map_cam = DepthScene::looking({0, 0, 1.2}, {0, 3, 0});
  const PointCloud cloud = rounded_cloud(scene, T_map_cam, 0.01);
  const SurfacePoints surface = described(cloud.points);
  ASSERT_FALSE(surface.noise_m.empty());
  int looked = 0;
  for (std::size_t i = 0; i < surface.size(); i += 97) {
    const double z = (T_map_cam.inverse() * surface.position[i].cast<double>()).z();
    if (z < 2 || z > 4) continue;
    const double expected = 0.01 * z * z / std::sqrt(12.0);
    EXPECT_NEAR(surface.noise_at(i), expected, 0.3 * expected) << z;
    ++looked;
  }
  EXPECT_GT(looked, 100);
}

TEST(DepthSteps, ACornerSeenInStepsHasItsThreeCreases) {
  DepthScene scene = depth_corner(5);
  const PointCloud cloud = rounded_cloud(scene, DepthScene::looking({1.6, 1.8, 1.3}, {0.3, 0.3, 0.4}), 0.003);
  const auto built = build(cloud);
  ASSERT_TRUE(built.ok()) << built.error().line();
  const AxisCreases creases = creases_of(built->map);
  EXPECT_GT(creases.length_m.minCoeff(), 0.5) << creases.length_m.transpose();
  EXPECT_LT(creases.worst_m, 0.015);
}

TEST(DepthSteps, AreNotSeenInCloudsWithoutNoise) {
  std::mt19937 random(13);
  std::uniform_real_distribution<float> share(0, 1);
  std::vector<Eigen::Vector3f> cube;
  for (int i = 0; i < 30000; ++i) {
    Eigen::Vector3f p(share(random), share(random), share(random));
    p[i % 3] = i % 2 == 0 ? 0.0F : 1.0F;
    cube.push_back(p);
  }
  const auto scale = measure_scale(cube, Neighbours(cube), {}, "cube");
  ASSERT_TRUE(scale.ok());
  EXPECT_FALSE(scale->layered());
  EXPECT_LT(scale->noise_m, 0.001);
}

TEST(DepthSteps, AreTheDistanceOfTheNearestParallelLayer) {
  std::mt19937 random(14);
  std::uniform_real_distribution<double> share(-0.5, 0.5);
  std::vector<Eigen::Vector3d> layers, bend;
  for (int i = 0; i < 400; ++i) {
    const double x = share(random), y = share(random);
    layers.emplace_back(x, y, 0.02 * std::round(4 * x));
    bend.emplace_back(x, y, std::max(0.0, x - 0.1));
  }
  const auto sorted = [](std::vector<Eigen::Vector3d> points) {
    std::sort(points.begin(), points.end(),
              [](const auto& a, const auto& b) { return a.squaredNorm() < b.squaredNorm(); });
    return points;
  };
  const DepthStep step = find_depth_step(sorted(layers), 1e-5);
  EXPECT_NEAR(step.step_m, 0.02, 1e-6);
  EXPECT_NEAR(std::abs(step.normal.z()), 1, 1e-6);
  EXPECT_EQ(find_depth_step(sorted(bend), 1e-5).step_m, 0);
  EXPECT_EQ(find_depth_step({}, 1e-5).step_m, 0);
}

}  // namespace
}  // namespace evpose::map_build
