// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/depth_fusion.h"

#include <gtest/gtest.h>

#include "evpose/core/parallel.h"
#include "evpose/map_build/test_depth.h"

namespace evpose::map_build {
namespace {

/// Of a board before the camera, which moves a little from image to image.
DepthFusion fused_wall(const DepthFusionConfig& config, int images, double distance_m) {
  DepthScene scene(3);
  scene.rectangle({-0.5, distance_m, -0.5}, {1, 0, 0}, {0, 0, 1});
  DepthFusion fusion(config);
  for (int k = 0; k < images; ++k) {
    const Pose T_map_cam = DepthScene::looking({0.02 * k - 0.2, 0.004 * k, 0.013 * k}, {0, distance_m, 0});
    EXPECT_TRUE(fusion.add(scene.samples(T_map_cam, config), T_map_cam).ok());
  }
  return fusion;
}

TEST(DepthNoise, GrowsWithTheSquareOfDepthAndIsNeverLessThanTheRounding) {
  const DepthNoise noise{0.001, 0.002, 0};
  EXPECT_DOUBLE_EQ(noise.sigma_m(1), 0.003);
  EXPECT_NEAR((noise.sigma_m(4) - 0.001) / (noise.sigma_m(2) - 0.001), 4, 1e-9);
  EXPECT_DOUBLE_EQ((DepthNoise{0, 0, 0.012}.sigma_m(3)), 0.012 / std::sqrt(12.0));
}

TEST(DepthSamples, ScatterAsTheirSigmaSays) {
  const DepthFusionConfig config;
  for (const double z : {1.0, 2.0, 4.0}) {
    DepthScene scene(1);
    scene.rectangle({-9, -9, z}, {18, 0, 0}, {0, 18, 0});
    double sum = 0;
    const auto samples = scene.samples(Pose(), config);
    ASSERT_GT(samples.size(), 70'000U);
    for (const DepthSample& s : samples) {
      const double along = (s.position.z() - z) * s.position.norm() / s.position.z();
      sum += along * along / (s.sigma_m * s.sigma_m);
    }
    EXPECT_NEAR(std::sqrt(sum / static_cast<double>(samples.size())), 1, 0.05) << z;
  }
}

TEST(DepthSamples, BesideAStepAreLeftOutAndOnASlopeKept) {
  const DepthFusionConfig config;
  const ImageSize size{6, 1};
  const std::vector<Eigen::Vector3f> rays(6, Eigen::Vector3f(0, 0, 1));
  const auto depths = [&](const std::vector<std::uint16_t>& image) {
    std::vector<int> out;
    for (const DepthSample& s : samples_of({size, image}, rays, 500, config))
      out.push_back(static_cast<int>(std::lround(1000 * s.position.z())));
    return out;
  };
  // A flying pixel between 1 m and 2 m.
  EXPECT_EQ(depths({1000, 1000, 1000, 1600, 2000, 2000}), (std::vector<int>{1000, 1000, 2000}));
  EXPECT_EQ(depths({1000, 1008, 1016, 1024, 1032, 1040}).size(), 6U);
  // None, too near, too far.
  EXPECT_EQ(depths({0, 0, 50, 50, 6000, 6000}), std::vector<int>());
}

TEST(DepthFusion, PutsAWallWhereItIsWithinTheStatedSigma) {
  ThreadPool pool(1);
  for (const double distance_m : {1.0, 2.0, 3.0})
    for (const int images : {1, 20}) {
      const auto points = fused_wall({}, images, distance_m).points(pool);
      ASSERT_GT(points.size(), 2000U);
      double sum = 0, errors = 0;
      for (const MeasuredPoint& p : points) {
        const double error = p.position.y() - distance_m;
        sum += error;
        errors += error * error / (static_cast<double>(p.sigma_m) * static_cast<double>(p.sigma_m));
      }
      const auto count = static_cast<double>(points.size());
      EXPECT_LT(std::abs(sum / count), 0.1 * DepthNoise().sigma_m(distance_m))
          << distance_m << " m, " << images;
      EXPECT_LT(std::sqrt(errors / count), 1.15) << distance_m << " m, " << images;
    }
}

TEST(DepthFusion, MakesAWallOfManyImagesThinnerThanOfOne) {
  ThreadPool pool(1);
  const auto thickness = [&](int images) {
    double sum = 0;
    const auto points = fused_wall({}, images, 2).points(pool);
    for (const MeasuredPoint& p : points) sum += std::pow(p.position.y() - 2, 2);
    return std::sqrt(sum / static_cast<double>(points.size()));
  };
  EXPECT_LT(thickness(20), 0.5 * thickness(1));
}

TEST(DepthFusion, IsTheSameForAnyNumberOfThreads) {
  const DepthFusion fusion = fused_wall({}, 3, 2);
  ThreadPool one(1), three(3);
  const auto a = fusion.points(one), b = fusion.points(three);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].position, b[i].position);
    ASSERT_EQ(a[i].sigma_m, b[i].sigma_m);
  }
}

TEST(DepthFusion, HasBoundsAndSaysSo) {
  DepthFusionConfig config;
  config.most_voxels = 10;
  DepthFusion small(config);
  const std::vector<DepthSample> row = [] {
    std::vector<DepthSample> out;
    for (int i = 0; i < 20; ++i) out.push_back({{0.1F * static_cast<float>(i), 0, 1}, 0.01F});
    return out;
  }();
  const Status full = small.add(row, Pose());
  ASSERT_FALSE(full.ok());
  EXPECT_NE(full.error().line().find("more than 10 voxels"), std::string::npos);
  Pose far;
  far.p.x() = 1e6;
  EXPECT_FALSE(DepthFusion({}).add(row, far).ok());
}

TEST(DepthFusion, NamesViewpointsFarFromEachOther) {
  const DepthFusion fusion = fused_wall({}, 20, 2);
  const auto eyes = fusion.viewpoints(8);
  ASSERT_EQ(eyes.size(), 2U);  // 0.46 m from end to end
  EXPECT_GT((eyes[0] - eyes[1]).norm(), 0.4);
}

}  // namespace
}  // namespace evpose::map_build
