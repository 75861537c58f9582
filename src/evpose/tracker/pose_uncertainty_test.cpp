// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

constexpr double kFocal_px = 300, kDepth_m = 2;

std::shared_ptr<const Camera> camera() {
  CameraIntrinsics intrinsics;
  intrinsics.fx = intrinsics.fy = kFocal_px;
  intrinsics.cx = 319.5;
  intrinsics.cy = 239.5;
  intrinsics.distortion_model = "radtan";
  intrinsics.distortion = {-0.1, 0.02, 0, 0};
  intrinsics.size = {640, 480};
  return *make_camera(intrinsics);
}

const Pose kT_body_cam{so3::exp({0.1, -0.2, 1.3}), {0.05, -0.02, 0.1}};

FusionState state_at(const Pose& T_map_body) {
  FusionState state;
  state.nav.T_map_body = T_map_body;
  return state;
}

// Of one error alone: how far the pixels of fixed points move when it is added.
TEST(PoseUncertainty, IsHowFarPointsMoveInTheImage) {
  const auto lens = camera();
  const Pose T_map_body{so3::exp({0.4, 0.3, -0.8}), {3, -1, 2}};
  Vector6d directions[] = {{1, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 1, 0}, {0.4, -0.3, 0.7, 0.2, -0.5, 0.6}};
  for (const Vector6d& direction : directions) {
    const Vector6d error = 1e-5 * direction;
    FusionState state = state_at(T_map_body), moved = state;
    state.covariance.topLeftCorner<6, 6>() = error * error.transpose();
    Vector15d d = Vector15d::Zero();
    d.head<6>() = error;
    moved.add(d);
    double sum = 0;
    for (const double x : {0.25, 0.5, 0.75}) {
      for (const double y : {0.25, 0.5, 0.75}) {
        const Eigen::Vector2d pixel(x * 639, y * 479);
        const Eigen::Vector3d point_map = T_map_body * (kT_body_cam * (kDepth_m * *lens->unproject(pixel)));
        const Eigen::Vector3d seen = kT_body_cam.inverse() * (moved.nav.T_map_body.inverse() * point_map);
        sum += (*lens->project(seen) - pixel).squaredNorm();
      }
    }
    const PoseUncertainty uncertainty(state, {*lens, kT_body_cam, kDepth_m});
    EXPECT_NEAR(uncertainty.image_px(), std::sqrt(sum / 9), 1e-3 * std::sqrt(sum / 9));
  }
}

// A turn that takes back what a shift does to the image: the image is known, position and rotation are not.
TEST(PoseUncertainty, PositionAndRotationMayHoldTheImageTogether) {
  const auto lens = camera();
  const Pose identity;
  FusionState state = state_at(identity);
  constexpr double kShift_m = 0.05;
  Vector6d error;
  error << kShift_m, 0, 0, 0, -kShift_m / kDepth_m, 0;  // to the right, turned to the left
  state.covariance.topLeftCorner<6, 6>() = error * error.transpose();
  const PoseUncertainty together(state, {*lens, identity, kDepth_m});
  EXPECT_NEAR(together.separate_px(), kFocal_px * kShift_m / kDepth_m, 1e-6);
  EXPECT_LT(together.image_px(), 0.2 * together.separate_px());
  state.covariance.topLeftCorner<6, 6>() = error.cwiseAbs2().asDiagonal();
  const PoseUncertainty apart(state, {*lens, identity, kDepth_m});
  EXPECT_GT(apart.image_px(), apart.separate_px());
}

}  // namespace
}  // namespace evpose
