// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/outlines.h"
#include "evpose/map_build/plane_split.h"
#include "evpose/map_build/test_scan.h"

namespace evpose::map_build {
namespace {

TEST(SurfacePoints, NoiseAndSpacingOfAPlaneAreWhatTheyWereMadeWith) {
  const auto points = Scan(1).rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0}).cloud().points;
  const auto scale = measure_scale(points, Neighbours(points), {}, "scan");
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->noise_m, kNoise, 0.1 * kNoise);
  EXPECT_NEAR(scale->spacing_m, 0.02, 0.002);
}

TEST(SurfacePoints, NormalsAreKnownAsWellAsWasAskedFor) {
  const auto points = Scan(2).rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0}).cloud().points;
  const PatchConfig config;
  const SurfacePoints surface = described(points);
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const auto& p = surface.position[i];
    if (p.x() < 0.2F || p.x() > 1.8F || p.y() < 0.2F || p.y() > 1.8F) continue;
    sum += surface.normal[i].head<2>().cast<double>().squaredNorm();
    ++count;
  }
  // Two tilts.
  const double sigma = std::sqrt(sum / count / 2);
  EXPECT_LT(sigma, 1.3 * config.normal_sigma_rad);
  EXPECT_GT(sigma, 0.5 * config.normal_sigma_rad);
}

TEST(Neighbours, WithinIsWhatCountingFinds) {
  std::mt19937 random(28);
  std::uniform_real_distribution<float> share(0, 1);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 2000; ++i) points.emplace_back(share(random), share(random), share(random));
  const Neighbours tree(points);
  std::vector<std::uint32_t> found;
  const Eigen::Vector3f p(0.4F, 0.5F, 0.6F);
  tree.within(p, 0.2F, found);
  std::sort(found.begin(), found.end());
  std::vector<std::uint32_t> counted;
  for (std::uint32_t i = 0; i < points.size(); ++i)
    if ((points[i] - p).norm() < 0.2F) counted.push_back(i);
  EXPECT_EQ(found, counted);
}

TEST(Outline, HasTheAreaOfThePlateWithoutItsHole) {
  Scan scan(10);  // a frame of four boards around a hole of 0.6 x 0.4
  scan.rectangle({0, 0, 0}, {1.2, 0, 0}, {0, 0.3, 0}, 8000)
      .rectangle({0, 0.7, 0}, {1.2, 0, 0}, {0, 0.3, 0}, 8000);
  scan.rectangle({0, 0.3, 0}, {0.3, 0, 0}, {0, 0.4, 0}, 8000)
      .rectangle({0.9, 0.3, 0}, {0.3, 0, 0}, {0, 0.4, 0}, 8000);
  const auto points = scan.cloud().points;
  const SurfacePoints surface = described(points);
  const Planes planes = find_planes(surface, {});
  ASSERT_EQ(planes.planes.size(), 1U);
  const Outline outline = trace_outline(surface, planes.planes[0]);
  ASSERT_EQ(outline.rings.size(), 2U);
  EXPECT_EQ(outline.rings[1].hole_of, 0);
  EXPECT_GT(twice_area(outline.rings[0].corners), 0);
  EXPECT_NEAR(0.5 * (twice_area(outline.rings[0].corners) + twice_area(outline.rings[1].corners)), 1.2 - 0.24,
              0.08);
  // What hides for certain is smaller by a cell all round.
  ASSERT_EQ(outline.solid.size(), 2U);
  const double solid = 0.5 * (twice_area(outline.solid[0].corners) + twice_area(outline.solid[1].corners));
  EXPECT_NEAR(solid, 1.2 - 0.24 - outline.cell_m * (2 * 2.2 + 2 * 1.0), 0.08);
}

TEST(Outline, WhatPointsAreTooFewToCoverHidesNothing) {
  Scan scan(32);  // a wall; over half of it only slats of 3 cm, 12 cm apart, have points
  scan.rectangle({0, 0, 0}, {1, 0, 0}, {0, 1.2, 0}, 8000);
  for (int k = 0; k < 8; ++k) scan.rectangle({1.09 + 0.12 * k, 0, 0}, {0.03, 0, 0}, {0, 1.2, 0}, 8000);
  const auto points = scan.cloud().points;
  const SurfacePoints surface = described(points);
  const Planes planes = find_planes(surface, {});
  ASSERT_GE(planes.planes.size(), 1U);
  double solid = 0;
  for (const FittedPlane& plane : planes.planes)
    for (const Ring& ring : trace_outline(surface, plane).solid) solid += 0.5 * twice_area(ring.corners);
  EXPECT_GT(solid, 0.9);
  EXPECT_LT(solid, 1.25);
}

TEST(PlaneSplit, LayersOfOnePlaneArePartedAndASinglePlaneIsNot) {
  for (const double step_m : {0.0, 0.025, 0.04}) {
    const PointCloud cloud = Scan(7)
                                 .rectangle({0, 0, 0}, {4, 0, 0}, {0, 0, 1.7})
                                 .rectangle({0, step_m, 1.7}, {4, 0, 0}, {0, 0, 0.8})
                                 .cloud();
    const SurfacePoints surface = described(cloud.points);
    std::vector<std::int32_t> label(cloud.points.size(), 0);
    const std::int32_t planes = split_layered_planes(surface, 40, 1, label);
    if (step_m == 0) {
      EXPECT_EQ(planes, 1);
      continue;
    }
    ASSERT_EQ(planes, 2) << step_m;
    constexpr double kCell_m = 0.1;  // points whose cell lies on both layers may go to either
    int wrong = 0, sure = 0;
    for (std::size_t i = 0; i < label.size(); ++i) {
      const double height_m = static_cast<double>(surface.position[i].z());
      if (std::abs(height_m - 1.7) < kCell_m) continue;
      ++sure;
      wrong += (label[i] == 1) != (height_m > 1.7);
    }
    EXPECT_LT(wrong, 0.03 * sure) << step_m;
  }
}

}  // namespace
}  // namespace evpose::map_build
