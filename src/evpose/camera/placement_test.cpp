// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/placement.h"

#include <gtest/gtest.h>

#include <numbers>

namespace evpose {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// A camera turned from "forward, upright" by yaw to the left, pitch down and roll clockwise about its axis.
Pose camera(double yaw_deg, double pitch_deg, double roll_deg, const Eigen::Vector3d& p) {
  Eigen::Matrix3d forward;  // x right, y down, z forward in the body's x forward, y left, z up
  forward << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Eigen::Quaterniond q = so3::exp({0, 0, yaw_deg * kDegree}) * so3::exp({0, pitch_deg * kDegree, 0}) *
                               Eigen::Quaterniond(forward) * so3::exp({0, 0, roll_deg * kDegree});
  return {q, p};
}

TEST(Placement, WordsForTheUsualMounts) {
  EXPECT_EQ(placement_in_words(camera(0, 33, 0, {0.012, 0.003, 0.04})),
            "12 mm ahead, 3 mm left, 40 mm above; looks forward, 33 deg down, upright");
  EXPECT_EQ(placement_in_words(camera(0, 0, 180, {-0.05, -0.02, -0.1})),
            "50 mm behind, 20 mm right, 100 mm below; looks forward, upside down");
  EXPECT_EQ(placement_in_words(camera(90, 0, 0, {0, 0, 0})), "at the body's origin; looks left, upright");
  EXPECT_EQ(placement_in_words(camera(-90, -10, 0, {0.1, 0, 0})),
            "100 mm ahead; looks right, 10 deg up, upright");
  EXPECT_EQ(placement_in_words(camera(180, 0, 0, {0, 0.1, 0})), "100 mm left; looks backward, upright");
  EXPECT_EQ(placement_in_words(camera(-20, 0, 0, {0, 0, 0})),
            "at the body's origin; looks 20 deg right of forward, upright");
  EXPECT_EQ(placement_in_words(camera(0, 90, 0, {0, 0, 0})),
            "at the body's origin; looks down, top of the image forward");
}

TEST(Placement, RollIsClockwiseAsTheCameraSeesItself) {
  // The camera's right side goes down: its x axis gains a downward part.
  const Pose turned = camera(0, 0, 15, {0, 0, 0});
  EXPECT_LT((turned.q * Eigen::Vector3d::UnitX()).z(), 0);
  EXPECT_EQ(placement_in_words(turned), "at the body's origin; looks forward, rolled 15 deg clockwise");
  EXPECT_EQ(placement_in_words(camera(0, 0, -90, {0, 0, 0})),
            "at the body's origin; looks forward, rolled 90 deg anticlockwise");
}

}  // namespace
}  // namespace evpose
