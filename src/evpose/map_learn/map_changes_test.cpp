// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/map_changes.h"

#include <gtest/gtest.h>

namespace evpose::map_learn {
namespace {

/// A rim along x, 10 cm long, within one cube of the segments.
void add_rim(ContourMap& map, float y, std::int32_t contour, float z = 0.05F) {
  for (int i = 0; i < 10; ++i) {
    ContourPoint p;
    p.position = {0.01F + 0.01F * static_cast<float>(i), y, z};
    p.tangent = Eigen::Vector3f::UnitX();
    p.normal = Eigen::Vector3f::UnitY();
    p.length = 0.01F;
    p.sigma = 1e-3F;
    p.contour = contour;
    p.kind = ContourKind::boundary;
    map.points.push_back(p);
  }
}

ContourMap rims(const std::vector<float>& ys) {
  ContourMap map;
  for (std::size_t i = 0; i < ys.size(); ++i) add_rim(map, ys[i], static_cast<std::int32_t>(i));
  return map;
}

TEST(MapChanges, AMapIsTheSameAsItself) {
  const MapChanges changes = compare_dates(rims({0, 0.05F, 1}), rims({0, 0.05F, 1}));
  EXPECT_TRUE(changes.changes.empty());
  EXPECT_NEAR(changes.same_m, 0.3, 1e-6);
}

TEST(MapChanges, WhatMovedWentOrCameIsToldWithItsLengthAndSigma) {
  const MapChanges changes = compare_dates(rims({0.03F, 1, 2}), rims({0.07F, 1, 3}));
  ASSERT_EQ(changes.changes.size(), 3u);
  EXPECT_EQ(changes.changes[0].change, Change::moved);
  EXPECT_NEAR((changes.changes[0].moved_m - Eigen::Vector3d(0, 0.04, 0)).norm(), 0, 1e-6);
  EXPECT_NEAR(changes.changes[0].sigma_m, std::sqrt(2) * 1e-3, 1e-6);
  EXPECT_EQ(changes.changes[1].change, Change::gone);
  EXPECT_NEAR(changes.changes[1].middle.y(), 2, 1e-6);
  EXPECT_EQ(changes.changes[2].change, Change::added);
  EXPECT_NEAR(changes.length_m(Change::added), 0.1, 1e-6);
  EXPECT_NEAR(changes.same_m, 0.1, 1e-6);
}

TEST(MapChanges, AMoveBelowThreeSigmasIsNone) {
  EXPECT_TRUE(compare_dates(rims({0.03F}), rims({0.034F})).changes.empty());
  EXPECT_EQ(compare_dates(rims({0.03F}), rims({0.036F})).count(Change::moved), 1u);
}

TEST(MapChanges, AContourThatIsGoneDoesNotTakeItsNeighbourForItself) {
  const MapChanges changes = compare_dates(rims({0.01F, 0.05F}), rims({0.05F}));
  ASSERT_EQ(changes.changes.size(), 1u);
  EXPECT_EQ(changes.changes[0].change, Change::gone);
  EXPECT_NEAR(changes.changes[0].middle.y(), 0.01, 1e-6);
}

}  // namespace
}  // namespace evpose::map_learn
