// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/contour_segments.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

namespace evpose {
namespace {

void add_line(ContourMap& map, const Eigen::Vector3f& from, const Eigen::Vector3f& direction, int count,
              std::int32_t contour = -1, std::int32_t plane = 0) {
  for (int k = 0; k < count; ++k) {
    ContourPoint p;
    p.position = from + 0.01F * static_cast<float>(k) * direction;
    p.tangent = direction;
    p.contour = contour;
    p.plane_a = plane;
    map.points.push_back(p);
  }
}

TEST(ContourSegments, AMetreOfALineIsCutIntoShortSegments) {
  ContourMap map;
  add_line(map, {0.001F, 0.001F, 0.001F}, {1, 0, 0}, 100);
  const ContourSegments segments = cut_into_segments(map);
  EXPECT_EQ(segments.count, 9u);  // cubes of 12 cm
  for (std::size_t i = 1; i < 100; ++i) EXPECT_LE(segments.of_point[i] - segments.of_point[i - 1], 1u);
}

TEST(ContourSegments, ParallelEdgesOfABoardAreApart) {
  ContourMap map;
  add_line(map, {0.01F, 0.01F, 0.01F}, {1, 0, 0}, 8);
  add_line(map, {0.01F, 0.02F, 0.01F}, {1, 0, 0}, 8);
  add_line(map, {0.01F, 0.01F, 0.01F}, {1, 0, 0}, 8, -1, 1);  // of another plane
  EXPECT_EQ(cut_into_segments(map).count, 3u);
}

TEST(ContourSegments, NumbersOfTheMapCountMoreThanDistance) {
  ContourMap map;
  add_line(map, {0.01F, 0.01F, 0.01F}, {1, 0, 0}, 4, 7);
  add_line(map, {0.05F, 0.01F, 0.01F}, {1, 0, 0}, 4, 8);
  const ContourSegments segments = cut_into_segments(map);
  EXPECT_EQ(segments.count, 2u);
  EXPECT_NE(segments.of_point[3], segments.of_point[4]);
}

TEST(ContourSegments, DoNotDependOnTheOrderOfPoints) {
  ContourMap map;
  add_line(map, {0.01F, -0.3F, 0.01F}, {0, 1, 0}, 60);
  add_line(map, {0.01F, -0.3F, 0.03F}, {0, 1, 0}, 60);
  const ContourSegments before = cut_into_segments(map);
  std::vector<std::size_t> order(map.points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), std::mt19937(3));
  ContourMap shuffled;
  for (const std::size_t i : order) shuffled.points.push_back(map.points[i]);
  const ContourSegments after = cut_into_segments(shuffled);
  ASSERT_EQ(after.count, before.count);
  for (std::size_t a = 0; a < order.size(); ++a)
    for (std::size_t b = 0; b < order.size(); ++b)
      EXPECT_EQ(after.of_point[a] == after.of_point[b],
                before.of_point[order[a]] == before.of_point[order[b]]);
}

TEST(ContourSegments, NoPointsNoSegments) { EXPECT_EQ(cut_into_segments({}).count, 0u); }

}  // namespace
}  // namespace evpose
