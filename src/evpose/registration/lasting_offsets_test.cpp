// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/lasting_offsets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "evpose/registration/rearranged.h"

namespace evpose {
namespace {

constexpr std::uint32_t kSegments = 40;
constexpr double kUpdate_s = 1.0 / 300;

/// Contours all around, whose events ask for what `offset_px` says of each, along its normal in the map.
class Scene {
 public:
  explicit Scene(double map_sigma_px = 0.1) : map_sigma_px_(map_sigma_px), by_pose_(kSegments) {
    std::uniform_real_distribution<double> place(-1, 1);
    for (Vector6d& J : by_pose_)
      for (int i = 0; i < 6; ++i) J(i) = 100 * place(random_);
  }

  const Vector6d& by_pose(std::uint32_t segment) const { return by_pose_[segment]; }

  void show(LastingOffsets& lasting, double seconds, const std::function<double(std::uint32_t)>& offset_px) {
    std::normal_distribution<double> scatter(0, 0.1);
    for (int k = 0; k * kUpdate_s < seconds; ++k) {
      std::vector<LastingOffsets::Sample> samples;
      for (std::uint32_t i = 0; i < kSegments; ++i) {
        const int side = i % 2 == 0 ? 1 : -1;
        const double weight = 3;
        samples.push_back({i, side, weight, weight * (side * offset_px(i) + scatter(random_)), map_sigma_px_,
                           &by_pose_[i]});
      }
      lasting.judge(kUpdate_s, samples);
    }
  }

 private:
  double map_sigma_px_;
  std::mt19937 random_{7};
  std::vector<Vector6d> by_pose_;  ///< along the sample's normal
};

double one_off(std::uint32_t segment) { return segment == 3 ? 0.5 : 0; }

TEST(LastingOffsets, AContourBesideItsEventsLosesWeightAndTheOthersKeepTheirs) {
  Scene scene;
  LastingOffsets lasting(kSegments);
  scene.show(lasting, 0.5, one_off);
  EXPECT_TRUE(lasting.agree());
  for (std::uint32_t i = 0; i < kSegments; ++i)
    if (i == 3)
      EXPECT_LT(lasting.trust(i), 0.1);
    else
      EXPECT_GT(lasting.trust(i), 0.95) << i;
}

TEST(LastingOffsets, AnErrorOfThePoseTakesNoWeightFromContours) {
  Scene scene;
  LastingOffsets lasting(kSegments);
  Vector6d off;
  off << 4e-3, -3e-3, 5e-3, 2e-3, -4e-3, 3e-3;
  double largest_px = 0;
  const auto asked = [&](std::uint32_t i) {
    const double px = (i % 2 == 0 ? 1 : -1) * scene.by_pose(i).dot(off);
    largest_px = std::max(largest_px, std::abs(px));
    return px;
  };
  scene.show(lasting, 0.5, asked);
  EXPECT_GT(largest_px, 0.8);
  for (std::uint32_t i = 0; i < kSegments; ++i) EXPECT_GT(lasting.trust(i), 0.95) << i;
}

TEST(LastingOffsets, WhereManyStandOffEachItsOwnWayLittleIsTakenAndTheContoursDoNotAgree) {
  Scene scene;
  LastingOffsets lasting(kSegments);
  scene.show(lasting, 0.5,
             [](std::uint32_t i) { return i % 3 == 0 ? 0 : std::copysign(0.6, std::sin(7.0 * i)); });
  EXPECT_FALSE(lasting.agree());
  double kept = 0;
  for (std::uint32_t i = 0; i < kSegments; ++i) kept += lasting.trust(i) / kSegments;
  EXPECT_NEAR(kept, 0.9, 0.01);
  scene.show(lasting, 2, one_off);
  EXPECT_TRUE(lasting.agree());
}

TEST(LastingOffsets, WhatIsOverIsForgotten) {
  Scene scene;
  LastingOffsets lasting(kSegments);
  scene.show(lasting, 0.5, one_off);
  scene.show(lasting, 2, [](std::uint32_t) { return 0.0; });
  EXPECT_GT(lasting.trust(3), 0.95);
  scene.show(lasting, 0.5, one_off);
  lasting.forget();
  EXPECT_EQ(lasting.trust(3), 1);
}

TEST(LastingOffsets, AMapThatIsUnsureByMoreAllowsForMore) {
  Scene scene(0.4);
  LastingOffsets lasting(kSegments);
  scene.show(lasting, 0.5, one_off);
  EXPECT_GT(lasting.trust(3), 0.9);
}

TEST(LastingOffsets, FollowsSegmentsThatGetOtherNumbers) {
  Scene scene;
  LastingOffsets lasting(kSegments);
  scene.show(lasting, 0.5, one_off);
  const std::vector<std::uint32_t> before{kNewSegment, 3, 2};
  const double trust = lasting.trust(3);
  lasting.rearrange(before);
  EXPECT_EQ(lasting.trust(0), 1);
  EXPECT_EQ(lasting.trust(1), trust);
}

}  // namespace
}  // namespace evpose
