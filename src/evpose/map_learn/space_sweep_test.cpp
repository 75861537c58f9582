// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/space_sweep.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose::map_learn {
namespace {

using V = Eigen::Vector3d;

// A camera that goes 0.3 m to the right before a reference view in the middle; edges at 1.5 to 4 m.
constexpr double kFocal_cells = 300, kHalfWay_m = 0.15;
const SpaceSweep::View kView{{0.8, 0.6}, kFocal_cells, 1, 8, 48};

/// Events of the edge from a to b as seen along the way, scattered by half a cell.
void see(SpaceSweep& sweep, const V& a, const V& b, int events, std::mt19937& random,
         bool looking_straight = true) {
  std::uniform_real_distribution<double> share(0, 1), way(-kHalfWay_m, kHalfWay_m);
  std::normal_distribution<double> scatter(0, 0.5 / kFocal_cells);
  for (int i = 0; i < events; ++i) {
    const V centre(way(random), looking_straight ? 0 : 0.02, looking_straight ? 0 : 0.3 * way(random));
    const V seen = a + share(random) * (b - a) - centre;
    sweep.add(centre, V(seen.x() / seen.z() + scatter(random), seen.y() / seen.z() + scatter(random), 1));
  }
}

double off_line(const V& p, const V& a, const V& b) { return (p - a).cross((b - a).normalized()).norm(); }

TEST(SpaceSweep, AnEdgeIsFoundWhereItStandsFromAnyWay) {
  std::mt19937 random(1);
  for (const auto& [a, b] :
       {std::pair(V(-0.1, -0.3, 2), V(-0.05, 0.3, 2)), std::pair(V(0.4, -0.2, 1.5), V(0.3, 0.3, 1.8)),
        std::pair(V(-0.8, 0.5, 3.5), V(-0.5, -0.5, 4))})
    for (const bool straight : {true, false}) {
      SpaceSweep sweep(kView);
      see(sweep, a, b, 4000, random, straight);
      const auto lines = sweep.take_lines();
      ASSERT_FALSE(lines.empty());
      for (const SweptLine& line : lines) {
        // A tenth of a cell of the image, and what the sweep states along the ray.
        const double depth = line.a.z(),
                     reach = 4 * depth * depth * line.inverse_depth_sigma + depth / kFocal_cells;
        EXPECT_LT(off_line(line.a, a, b), reach);
        EXPECT_LT(off_line(line.b, a, b), reach);
        EXPECT_LT(depth * line.inverse_depth_sigma, 0.12);
      }
    }
}

TEST(SpaceSweep, TwoEdgesOneBehindTheOtherAreApart) {
  std::mt19937 random(2);
  SpaceSweep sweep(kView);
  see(sweep, V(-0.2, -0.3, 1.5), V(-0.2, 0.3, 1.5), 4000, random);
  see(sweep, V(0.1, -0.5, 3.5), V(0.1, 0.5, 3.5), 4000, random);
  int near = 0, far = 0;
  for (const SweptLine& line : sweep.take_lines()) {
    near += std::abs(line.a.z() - 1.5) < 0.06 && std::abs(line.a.x() + 0.2) < 0.01;
    far += std::abs(line.a.z() - 3.5) < 0.3 && std::abs(line.a.x() - 0.1) < 0.02;
  }
  EXPECT_GT(near, 0);
  EXPECT_GT(far, 0);
}

TEST(SpaceSweep, AnEdgeAlongTheMotionHasNoDepth) {
  std::mt19937 random(3);
  SpaceSweep sweep(kView);
  see(sweep, V(-0.4, 0.1, 2), V(0.4, 0.1, 2), 6000, random);
  EXPECT_TRUE(sweep.take_lines().empty());
}

TEST(SpaceSweep, RaysThatMeetNowhereMakeNoEdge) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> x(-0.8, 0.8), y(-0.6, 0.6), way(-kHalfWay_m, kHalfWay_m);
  SpaceSweep sweep(kView);
  for (int i = 0; i < 200'000; ++i) sweep.add({way(random), 0, 0}, {x(random), y(random), 1});
  EXPECT_TRUE(sweep.take_lines().empty());
}

}  // namespace
}  // namespace evpose::map_learn
