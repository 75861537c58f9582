// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/landmark_search.h"

#include <gtest/gtest.h>

#include <random>

namespace evpose {
namespace {

/// A wall, and events of lines before it.
class LandmarkSearchLaws : public ::testing::Test {
 protected:
  LandmarkSearchLaws() : camera_(*make_camera({200, 200, 159.5, 119.5, "none", {}, {320, 240}})) {
    map_.occluders.vertices = {{-9, -9, 3}, {9, -9, 3}, {9, 9, 3}, {-9, 9, 3}};
    map_.occluders.triangles = {{0, 1, 2}, {0, 2, 3}};
  }

  std::vector<FilteredEvent> slice() {
    std::uniform_int_distribution<int> x(20, 299), y(20, 219);
    std::vector<FilteredEvent> out;
    for (int line = 0; line < 40; ++line) {
      const int at = x(random_), first = y(random_);
      for (int k = 0; k < 12 && first + k < 230; ++k) {
        FilteredEvent e{};
        e.x = static_cast<std::uint16_t>(at), e.y = (first + k) & 0x7FFF;
        e.on = 1;
        e.stamp_us = 1000 + static_cast<std::uint32_t>(10 * line + k);
        out.push_back(e);
      }
    }
    return out;
  }

  std::mt19937 random_{3};
  std::shared_ptr<const Camera> camera_;
  ContourMap map_;
};

TEST_F(LandmarkSearchLaws, FindsTheSameBesideAndAtTheEnd) {
  const ContourIndex index(map_);
  LandmarkSearch beside(index, *camera_), at_the_end(index, *camera_);
  for (int round = 0; round < 3; ++round) {
    std::vector<FilteredEvent> one = slice(), other = one;
    beside.begin(one, 2000, {});
    beside.launch();
    at_the_end.begin(other, 2000, {});
    EXPECT_TRUE(one.empty());
    beside.finish(), at_the_end.finish();
    ASSERT_GT(beside.pieces().size(), 10u);
    ASSERT_EQ(beside.pieces().size(), at_the_end.pieces().size());
    for (std::size_t i = 0; i < beside.pieces().size(); ++i) {
      EXPECT_EQ(beside.pieces()[i].pixel, at_the_end.pieces()[i].pixel);
      EXPECT_EQ(beside.pieces()[i].normal, at_the_end.pieces()[i].normal);
    }
    ASSERT_TRUE(beside.depths().depth_at({0.1F, 0.2F}));
    EXPECT_EQ(beside.depths().depth_at({0.1F, 0.2F}), at_the_end.depths().depth_at({0.1F, 0.2F}));
  }
}

/// What was begun before and not asked for leaves nothing behind.
TEST_F(LandmarkSearchLaws, OneThatNobodyAsksForIsGivenUp) {
  const ContourIndex index(map_);
  LandmarkSearch search(index, *camera_), alone(index, *camera_);
  std::vector<FilteredEvent> events = slice();
  search.begin(events, 2000, {});
  search.launch();
  std::vector<FilteredEvent> one = slice(), other = one;
  search.begin(one, 2000, {});
  search.launch();
  alone.begin(other, 2000, {});
  search.finish(), alone.finish();
  ASSERT_GT(search.pieces().size(), 10u);
  ASSERT_EQ(search.pieces().size(), alone.pieces().size());
  for (std::size_t i = 0; i < alone.pieces().size(); ++i)
    EXPECT_EQ(search.pieces()[i].pixel, alone.pieces()[i].pixel) << i;
}

}  // namespace
}  // namespace evpose
