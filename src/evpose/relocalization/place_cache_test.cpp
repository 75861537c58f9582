// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/place_cache.h"

#include <gtest/gtest.h>

#include "evpose/relocalization/test_room.h"

namespace evpose {
namespace {

Eigen::AlignedBox3d box(double from, double to) {
  return {Eigen::Vector3d::Constant(from), Eigen::Vector3d::Constant(to)};
}

class PlaceCacheLaws : public ::testing::Test {
 protected:
  PlaceCacheLaws() : map_(test_room::map_of(test_room::room())), contours_(map_) {}

  ContourMap map_;
  ContourIndex contours_;
  VisibleSetConfig config_;
  PlaceCache cache_;
};

TEST_F(PlaceCacheLaws, WhatIsKnownIsNotMadeAgain) {
  const auto first = cache_.over(contours_, config_, box(1, 2));
  ASSERT_FALSE(first->places().empty());
  EXPECT_EQ(cache_.over(contours_, config_, box(1, 2)), first);
  EXPECT_EQ(cache_.over(contours_, config_, box(1.2, 1.8)), first) << "a part of it";
  EXPECT_NE(cache_.over(contours_, config_, box(1.5, 2.5)), first);
}

TEST_F(PlaceCacheLaws, AnotherTrackersIndexOfTheSameMapIsTheSame) {
  const auto first = cache_.over(contours_, config_, box(1, 2));
  const ContourMap copy = map_;
  EXPECT_EQ(cache_.over(ContourIndex(copy), config_, box(1, 2)), first);
}

TEST_F(PlaceCacheLaws, AnotherMapOrViewIsLookedAtAnew) {
  const auto first = cache_.over(contours_, config_, box(1, 2));
  ContourMap moved = map_;
  moved.points.back().position.x() += 0.01F;
  EXPECT_NE(cache_.over(ContourIndex(moved), config_, box(1, 2)), first);
  VisibleSetConfig near = config_;
  near.far_m = 2;
  EXPECT_NE(cache_.over(contours_, near, box(1, 2)), first);
}

TEST_F(PlaceCacheLaws, PlacesThatAreMuchCoarserAreNotTaken) {
  const auto wide = cache_.over(contours_, config_, box(-20, 20));
  const auto fine = cache_.over(contours_, config_, box(1, 2));
  EXPECT_NE(fine, wide);
  EXPECT_LT(fine->edge_m(), wide->edge_m() / 2);
}

}  // namespace
}  // namespace evpose
