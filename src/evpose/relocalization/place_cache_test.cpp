// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/place_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>

#include "evpose/relocalization/test_room.h"

namespace evpose {
namespace {

Eigen::AlignedBox3d box(double from, double to) {
  return {Eigen::Vector3d::Constant(from), Eigen::Vector3d::Constant(to)};
}

class PlaceCacheLaws : public ::testing::Test {
 protected:
  PlaceCacheLaws() : map_(walled(test_room::map_of(test_room::room()))), contours_(map_) {}
  /// With a wall across most of the room.
  static ContourMap walled(ContourMap map) {
    map.occluders.vertices = {{3, 0, 0}, {3, 4, 0}, {3, 4, 3}, {3, 0, 3}};
    map.occluders.triangles = {{0, 1, 2}, {0, 2, 3}};
    return map;
  }

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

void expect_same(const PlaceIndex& a, const PlaceIndex& b) {
  ASSERT_EQ(a.places().size(), b.places().size());
  EXPECT_EQ(a.edge_m(), b.edge_m());
  std::size_t seen = 0;
  for (std::size_t i = 0; i < a.places().size(); ++i) {
    EXPECT_EQ(a.places()[i].middle, b.places()[i].middle);
    for (int d = 0; d < PlaceIndex::kDirections; ++d) {
      const auto by_a = a.seen_from(a.places()[i], d), by_b = b.seen_from(b.places()[i], d);
      ASSERT_EQ(by_a.size(), by_b.size());
      for (std::size_t k = 0; k < by_a.size(); ++k, ++seen) {
        ASSERT_EQ(a.sample(by_a[k]).position, b.sample(by_b[k]).position);
        ASSERT_EQ(a.sample(by_a[k]).tangent, b.sample(by_b[k]).tangent);
      }
    }
  }
  EXPECT_GT(seen, 1000U);
}

TEST_F(PlaceCacheLaws, WhatWasKeptIsSeenAgain) {
  const Eigen::AlignedBox3d all = space_around(map_);
  PlaceTable table;
  const PlaceIndex made(contours_, config_, all, &table);
  std::size_t hidden = 0;
  for (const std::uint32_t count : table.looked_at) hidden += count == PlaceTable::kNoPlace ? 0 : count;
  for (const std::uint8_t bits : table.seen) hidden -= static_cast<std::size_t>(std::popcount(bits));
  ASSERT_GT(hidden, 1000U);
  PlaceCache cache(table);
  const auto kept = cache.over(contours_, config_, all);
  expect_same(*kept, made);
  EXPECT_EQ(cache.over(contours_, config_, all), kept);
  // It is the table that says what is seen.
  std::ranges::fill(table.seen, 0);
  EXPECT_TRUE(PlaceIndex(contours_, table).places().empty());
}

TEST_F(PlaceCacheLaws, PlacesOfWhichOtherPointsWereListedAreLookedAtAnew) {
  const Eigen::AlignedBox3d all = space_around(map_);
  PlaceTable table;
  const PlaceIndex made(contours_, config_, all, &table);
  std::ranges::fill(table.seen, 0);
  for (std::uint32_t& count : table.looked_at)
    if (count != PlaceTable::kNoPlace) --count;
  expect_same(PlaceIndex(contours_, table), made);
}

TEST_F(PlaceCacheLaws, ATableOfOtherPlacesIsNotTaken) {
  const Eigen::AlignedBox3d all = space_around(map_);
  PlaceTable table;
  const PlaceIndex made(contours_, config_, all, &table);
  table.looked_at.resize(3);
  expect_same(*PlaceCache(table).over(contours_, config_, all), made);
}

TEST_F(PlaceCacheLaws, WhatWasKeptOfAnotherMapIsNotTaken) {
  const Eigen::AlignedBox3d all = space_around(map_);
  PlaceTable table;
  const PlaceIndex made(contours_, config_, all, &table);
  std::ranges::fill(table.seen, 0);
  table.view ^= 1;
  expect_same(*PlaceCache(table).over(contours_, config_, all), made);
}

TEST_F(PlaceCacheLaws, ACopyHasTheSameIndicesAndMakesItsOwnFromThenOn) {
  const auto wide = cache_.over(contours_, config_, box(-20, 20));
  PlaceCache copy(cache_);
  EXPECT_EQ(copy.over(contours_, config_, box(-20, 20)), wide);
  const auto fine = copy.over(contours_, config_, box(1, 2));
  EXPECT_NE(cache_.over(contours_, config_, box(1, 2)), fine);
}

TEST_F(PlaceCacheLaws, PlacesThatAreMuchCoarserAreNotTaken) {
  const auto wide = cache_.over(contours_, config_, box(-20, 20));
  const auto fine = cache_.over(contours_, config_, box(1, 2));
  EXPECT_NE(fine, wide);
  EXPECT_LT(fine->edge_m(), wide->edge_m() / 2);
}

}  // namespace
}  // namespace evpose
