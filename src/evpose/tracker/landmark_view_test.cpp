// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/landmark_view.h"

#include <gtest/gtest.h>

#include <random>

namespace evpose {
namespace {

constexpr double kStep = 1e-6;

/// What a landmark's distance to its events depends on.
struct Situation {
  Pose T_map_body{so3::exp(Eigen::Vector3d(0.3, -0.2, 0.5)), {1, 2, 3}};
  Pose T_map_kept{so3::exp(Eigen::Vector3d(0.25, -0.15, 0.45)), {0.9, 2.1, 2.95}};
  Pose T_kept_then{so3::exp(Eigen::Vector3d(0.01, 0.02, -0.01)), {0.01, 0.02, 0}};
  Pose T_body_cam{so3::exp(Eigen::Vector3d(-1.2, 1.2, -1.2)), {0.1, -0.05, 0.02}};
  std::shared_ptr<AdjustedCamera> camera =
      *AdjustedCamera::create({310, 305, 320, 240, "radtan", {-0.2, 0.05, 0.001, -0.002}, {640, 480}});
  Eigen::Vector2d pixel{410, 190}, normal{0.6, 0.8};
  double depth_m = 3;

  LandmarkView view() const {
    const Eigen::Vector3d ray = *camera->unproject(pixel);
    return {T_map_body, T_map_kept, T_kept_then, T_body_cam, depth_m * ray / ray.z()};
  }
  /// Its distance to events that stand still.
  double distance_px() const { return -normal.dot(*camera->project(view().point_now())); }
};

double slope(const Situation& plus, const Situation& minus) {
  return (plus.distance_px() - minus.distance_px()) / (2 * kStep);
}

Vector6d along(int i) { return kStep * Vector6d::Unit(i); }

TEST(LandmarkView, RowIsTheDifferences) {
  const Situation at;
  RelativeInformation::Vector expected(RelativeInformation::kNumbers + at.camera->numbers());
  for (int i = 0; i < 6; ++i) {
    Situation a, b;
    a.T_map_body = at.T_map_body.plus(along(i)), b.T_map_body = at.T_map_body.plus(-along(i));
    expected(i) = slope(a, b);
    a = b = at;
    a.T_map_kept = at.T_map_kept.plus(along(i)), b.T_map_kept = at.T_map_kept.plus(-along(i));
    expected(6 + i) = slope(a, b);
  }
  for (int i = 0; i < 3; ++i) {
    Situation a, b;
    a.T_body_cam.q = so3::exp(kStep * Eigen::Vector3d::Unit(i)) * at.T_body_cam.q;
    b.T_body_cam.q = so3::exp(-kStep * Eigen::Vector3d::Unit(i)) * at.T_body_cam.q;
    expected(RelativeInformation::kPoses + i) = slope(a, b);
  }
  for (int i = 0; i < at.camera->numbers(); ++i) {
    constexpr double kPerNumber = 2e-3;  // large enough to make another camera
    const double step = i < 4 ? 1 : kPerNumber;
    Situation a, b;
    const auto change = AdjustedCamera::Correction::Unit(at.camera->numbers(), i);
    ASSERT_TRUE(a.camera->set_correction(step * change));
    ASSERT_TRUE(b.camera->set_correction(-step * change));
    expected(RelativeInformation::kNumbers + i) = (a.distance_px() - b.distance_px()) / (2 * step);
  }
  const auto row = landmark_row(at.view(), expected.head<6>(), at.normal, at.camera.get());
  ASSERT_EQ(row.size(), expected.size());
  for (int i = 0; i < row.size(); ++i)
    EXPECT_NEAR(row(i), expected(i), 1e-3 * std::abs(expected(i)) + 2e-3) << i;
  EXPECT_EQ(landmark_row(at.view(), expected.head<6>(), at.normal, nullptr),
            row.head<RelativeInformation::kNumbers>());
}

/// What does not move in the image says nothing of the camera.
TEST(LandmarkView, AtRestTheCameraIsNotSeen) {
  Situation at;
  at.T_map_kept = at.T_map_body;
  at.T_kept_then = {};
  const auto row = landmark_row(at.view(), Vector6d::Ones() * 100, at.normal, at.camera.get());
  EXPECT_LT(row.segment<3>(RelativeInformation::kPoses).norm(), 1e-9);
}

}  // namespace
}  // namespace evpose
