// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "evpose/map_build/edge_profile_fit.h"
#include "evpose/map_build/normal_table.h"
#include "evpose/map_build/step_fit.h"
#include "evpose/map_build/test_scan.h"

namespace evpose::map_build {
namespace {

TEST(NormalTable, IsTheNormalDistributionToFiveDigits) {
  for (double x = -9; x < 9; x += 0.0137) {
    EXPECT_NEAR(normal().density(x), std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI), 1e-5);
    EXPECT_NEAR(normal().below(x), 0.5 * std::erfc(-x / std::sqrt(2.0)), 1e-5);
    EXPECT_NEAR(normal().ramp(x + 1e-2) - normal().ramp(x - 1e-2), 2e-2 * normal().below(x), 1e-5);
  }
}

/// Points (along, outwards) that fill a metre of a strip evenly up to an edge, blurred by 8 mm; those within
/// `half_width` of zero.
std::vector<Eigen::Vector2d> points_up_to(double edge, double from, int count, double half_width,
                                          std::mt19937& random) {
  std::uniform_real_distribution<double> t(-0.5, 0.5), d(from, edge);
  std::normal_distribution<double> blur(0, 0.008);
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d p(t(random), d(random) + blur(random));
    if (std::abs(p.y()) < half_width) points.push_back(p);
  }
  return points;
}

TEST(StepFit, FindsTheEdgeOfADensityWithinItsOwnError) {
  std::mt19937 random(9);
  double squares = 0;
  constexpr int kTrials = 60;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto points = points_up_to(0.013, -0.1, 250, 0.08, random);
    const StepFit step = fit_step(points, 0.5, 0.08, 0.008);
    ASSERT_TRUE(step.converged);
    squares += std::pow((step.place - 0.013) / step.sigma_place, 2);
    EXPECT_LT(step.sigma_place, 0.003);
  }
  EXPECT_NEAR(squares / kTrials, 1, 0.6);
}

TEST(StepFit, TheTrueSoftnessIsTheLikeliest) {
  std::mt19937 random(27);
  const auto points = points_up_to(0.01, -0.15, 3000, 0.07, random);
  const StepFit right = fit_step(points, 0.5, 0.07, 0.008);
  ASSERT_TRUE(right.converged);
  EXPECT_NEAR(right.place, 0.01, 0.002);
  for (const double wrong : {0.002, 0.03, 0.045}) {
    const StepFit step = fit_step(points, 0.5, 0.07, wrong);
    EXPECT_LT(step.log_likelihood, right.log_likelihood);
  }
}

/// Points around an edge (along, outwards, over the plane) of a plane that ends at y = 0, of a face of
/// `depth` that hangs from it, and of what is under that; blurred along a ray of unit `ray`.
std::vector<Eigen::Vector3d> profile_points(unsigned seed, double depth, bool under,
                                            const Eigen::Vector2d& ray, int on_plane = 700) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, kNoise);
  std::uniform_real_distribution<double> t(-0.5, 0.5), y(-0.2, 0), z(-depth, 0);
  std::vector<Eigen::Vector3d> out;
  const auto add = [&](double along, double across, double over) {
    const Eigen::Vector2d p = Eigen::Vector2d(across, over) + noise(random) * ray;
    if (std::abs(p.x()) < 0.09 && std::abs(p.y()) < 0.09) out.emplace_back(along, p.x(), p.y());
  };
  for (int i = 0; i < on_plane; ++i) add(t(random), y(random), 0);
  for (int i = 0; i < static_cast<int>(5000 * depth); ++i) add(t(random), 0, z(random));
  for (int i = 0; under && i < 400; ++i) add(t(random), y(random), -depth);
  return out;
}

TEST(EdgeProfileFit, AFaceNarrowerThanItIsNoisyDoesNotPushTheEdge) {
  // A board of 25 mm seen at 45 degrees: both its edges, each within what is said of it.
  const EdgeProfileWindow window{0.5, 0.09, 0.09, kNoise, 0.7 * kNoise, 0.005};
  double place = 0, depth = 0;
  constexpr int kTrials = 12;
  for (unsigned seed = 0; seed < kTrials; ++seed) {
    const EdgeProfileFit fit =
        fit_edge_profile(profile_points(seed, 0.025, true, Eigen::Vector2d(1, 1).normalized()), window);
    ASSERT_EQ(fit.side, -1) << seed;
    EXPECT_TRUE(fit.ends);
    EXPECT_GT(fit.gain, 20);
    EXPECT_LT(fit.rest_share, 0.1);
    const double stated = std::hypot(fit.sigma_place, 0.1 * kNoise);  // a contour's: it never says less
    place += std::pow(fit.place / stated, 2) / kTrials;
    depth += std::pow((fit.depth - 0.025) / fit.sigma_depth, 2) / kTrials;
    EXPECT_LT(std::abs(fit.place), 0.004);
    EXPECT_LT(std::abs(fit.depth - 0.025), 0.012);
  }
  EXPECT_LT(place, 2);
  EXPECT_LT(depth, 4);
}

TEST(EdgeProfileFit, TheOtherWayUpIsTheSameFaceOnTheOtherSide) {
  const EdgeProfileWindow window{0.5, 0.09, 0.09, kNoise, kNoise, 0.005};
  auto points = profile_points(3, 0.06, false, {0.6, 0.8});
  const EdgeProfileFit down = fit_edge_profile(points, window);
  for (auto& p : points) p.z() = -p.z();
  const EdgeProfileFit up = fit_edge_profile(points, window);
  EXPECT_EQ(down.side, -1);
  EXPECT_EQ(up.side, 1);
  EXPECT_NEAR(down.place, up.place, 1e-6);
  EXPECT_NEAR(down.height, -up.height, 1e-6);
  EXPECT_NEAR(down.depth, up.depth, 1e-6);
}

TEST(EdgeProfileFit, APlaneThatMerelyEndsHasNoFace) {
  for (unsigned seed = 0; seed < 8; ++seed)
    for (const double angle : {0.0, 0.7, 1.2}) {
      const EdgeProfileWindow window{0.5, 0.09, 0.09, kNoise, kNoise * std::cos(angle), 0.005};
      const EdgeProfileFit fit =
          fit_edge_profile(profile_points(seed, 0, false, {std::sin(angle), std::cos(angle)}), window);
      EXPECT_LT(fit.gain, 10) << seed << " " << angle;
      EXPECT_TRUE(fit.side != 0 || std::abs(fit.place) < 0.01);
    }
}

TEST(EdgeProfileFit, PointsThatLeanAlongTheirRaysAreNoFace) {
  // A ceiling seen askew over a beam: its last points are lifted and shifted at once.
  for (unsigned seed = 0; seed < 6; ++seed)
    for (const double angle : {-1.0, -0.6, 0.6, 1.0}) {
      const EdgeProfileWindow window{0.5, 0.09, 0.09, kNoise, kNoise * std::cos(angle), 0.005};
      const EdgeProfileFit fit =
          fit_edge_profile(profile_points(seed, 0, false, {std::sin(angle), std::cos(angle)}, 4000), window);
      EXPECT_LT(fit.gain, 10) << seed << " " << angle;
      EXPECT_LT(std::abs(fit.place), 0.004) << seed << " " << angle;
    }
}

/// Few points of one scan line, gaps, steep faces: whatever a cloud has at its rim.
std::vector<Eigen::Vector3d> scraps(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Eigen::Vector3d> points;
  const double thickness = std::pow(10, -2 + 2 * unit(random)), lean = unit(random);
  const int count = 10 + static_cast<int>(random() % 60);
  for (int i = 0; i < count; ++i) {
    const double across = 0.05 * unit(random);
    points.emplace_back(0.5 * unit(random), across, lean * across + thickness * unit(random));
  }
  return points;
}

TEST(EdgeProfileFit, SaysNothingOrHasFiniteSigmas) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 3000; ++trial) {
    const double noise_m = 0.02 * std::pow(10, -static_cast<double>(random() % 5));
    const EdgeProfileFit fit =
        fit_edge_profile(scraps(random), edge_profile_window(0.5, noise_m, noise_m, 0.03));
    EXPECT_TRUE(std::isfinite(fit.sigma_place + fit.sigma_height + fit.sigma_depth)) << trial;
  }
}

}  // namespace
}  // namespace evpose::map_build
