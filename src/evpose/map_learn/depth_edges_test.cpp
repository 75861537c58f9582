// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/depth_edges.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace evpose::map_learn {
namespace {

using V = Eigen::Vector3d;
const V kA(0, 0, 3), kB(0.05, 0.4, 3.1);

/// The edge from kA to kB, moved along the line of sight and across it, as the view from there has it.
SweptPiece seen_from(const V& place, int view, double along_ray_m, const V& across_m = V::Zero()) {
  const V ray = (0.5 * (kA + kB) - place).normalized();
  const V off = along_ray_m * ray + across_m;
  return {kA + off, kB + off, ray, 0.005, 0.05, 20.0 + view, view};
}

double off_edge(const V& p) { return (p - kA).cross((kB - kA).normalized()).norm(); }

TEST(SharedPieces, WhatOneViewAloneHasIsLeftOut) {
  EXPECT_TRUE(shared_pieces({seen_from(V(0, 0, 0), 0, 0.01)}).empty());
  EXPECT_TRUE(shared_pieces({seen_from(V(0, 0, 0), 0, 0.01), seen_from(V(0.1, 0, 0), 0, -0.01)}).empty());
  EXPECT_EQ(shared_pieces({seen_from(V(0, 0, 0), 0, 0.01), seen_from(V(0.1, 0, 0), 1, -0.01)}).size(), 1U);
}

TEST(SharedPieces, ViewsFromOtherSidesTellTheDepthOfEachOther) {
  const SweptPiece left = seen_from(V(-1.5, 0, 1), 0, 0.04), right = seen_from(V(1.5, 0, 1), 1, -0.04);
  const auto shared = shared_pieces({left, right});
  ASSERT_EQ(shared.size(), 1U);
  EXPECT_LT(off_edge(shared[0].a), 0.5 * std::min(off_edge(left.a), off_edge(right.a)));
  EXPECT_LT(shared[0].along_ray_sigma_m, 0.02);
}

TEST(SharedPieces, WhatLiesFurtherApartThanStatedIsNotShared) {
  const V beside(0.05, 0, 0), behind(0, 0, 0.4);
  EXPECT_TRUE(shared_pieces({seen_from(V(0, 0, 0), 0, 0), seen_from(V(0.1, 0, 0), 1, 0, beside)}).empty());
  EXPECT_TRUE(shared_pieces({seen_from(V(0, 0, 0), 0, 0), seen_from(V(0.1, 0, 0), 1, 0, behind)}).empty());
  SweptPiece turned = seen_from(V(0.1, 0, 0), 1, 0);
  turned.b = turned.a + V(0.4, 0, 0);
  EXPECT_TRUE(shared_pieces({seen_from(V(0, 0, 0), 0, 0), turned}).empty());
}

}  // namespace
}  // namespace evpose::map_learn
