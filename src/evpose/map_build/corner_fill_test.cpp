// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/corner_fill.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace evpose::map_build {
namespace {

constexpr double kNoise_m = 0.02, kWindow_m = 0.24;

/// Points of a corner in which a thing of that size stands; `per_m`: points per metre of the cut.
std::vector<Eigen::Vector2d> corner(double width_m, double height_m, double per_m, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, kNoise_m);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Eigen::Vector2d> out;
  const auto face = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const Eigen::Vector2d along = (to - from).normalized(), across(-along.y(), along.x());
    const double length = (to - from).norm();
    for (int i = 0; i < std::lround(per_m * length); ++i)
      out.emplace_back(from + unit(random) * (to - from) + noise(random) * across);
  };
  // Heights over the first face (x) and the second (y).
  constexpr double kFar_m = 0.4;
  face({0, width_m}, {0, kFar_m});
  face({height_m, 0}, {kFar_m, 0});
  if (width_m > 0) face({height_m, 0}, {height_m, width_m}), face({0, width_m}, {height_m, width_m});
  return out;
}

TEST(CornerFill, AnEmptyCornerIsToldFromOneWithAKerb) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const CornerFill empty = corner_fill(corner(0, 0, 1000, seed), kNoise_m, kWindow_m);
    EXPECT_LT(empty.probability, 0.5) << seed;
    const CornerFill kerb = corner_fill(corner(0.06, 0.04, 1000, seed), kNoise_m, kWindow_m);
    EXPECT_GT(kerb.probability, 0.9) << seed;
    EXPECT_LT(std::abs(kerb.width_m - 0.06), 3.5 * kerb.sigma_width_m + 0.01) << seed;
    EXPECT_LT(std::abs(kerb.height_m - 0.04), 3.5 * kerb.sigma_height_m + 0.01) << seed;
  }
}

TEST(CornerFill, FewPointsLeaveItOpen) {
  constexpr int kCorners = 20;
  double mean = 0;
  for (unsigned seed = 0; seed < kCorners; ++seed)
    mean += corner_fill(corner(0, 0, 40, seed), kNoise_m, kWindow_m).probability / kCorners;
  EXPECT_NEAR(mean, 0.25, 0.15);
  EXPECT_EQ(corner_fill({}, kNoise_m, kWindow_m).probability, 0);
}

}  // namespace
}  // namespace evpose::map_build
