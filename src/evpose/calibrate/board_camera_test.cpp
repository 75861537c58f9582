// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/board_camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <random>

#include "evpose/camera/adjusted_camera.h"

namespace evpose {
namespace {

const CameraIntrinsics kTruth{510, 512, 330, 236, "radtan", {-0.12, 0.05, 4e-4, -3e-4}, {640, 480}};

CameraIntrinsics data_sheet() {
  CameraIntrinsics out = kTruth;
  out.fx *= 1.1;
  out.fy *= 1.1;
  out.cx = 320;
  out.cy = 240;
  out.distortion.assign(4, 0);
  return out;
}

Eigen::MatrixXd known_roughly() {
  Eigen::VectorXd sigma(8);
  sigma << 50, 50, 20, 20, 0.1, 0.1, 2e-3, 2e-3;
  return sigma.cwiseAbs2().asDiagonal();
}

class BoardBefore : public ::testing::Test {
 protected:
  BoardBefore() : camera_(*make_camera(kTruth)), lattice_(lattice_of(Checkerboard{9, 7, 0.08})) {}

  /// From about a metre before it, turned by some tenths of a radian about each axis.
  Pose pose() {
    const Eigen::Matrix3d forward = (Eigen::Matrix3d() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished();  // z is y
    const Eigen::Quaterniond looking(forward);
    std::uniform_real_distribution<double> u(-1, 1);
    const Eigen::Vector3d turn(0.4 * u(random_), 0.4 * u(random_), 0.6 * u(random_));
    const Eigen::Quaterniond q = so3::exp(Eigen::Vector3d(turn.x(), 0, turn.y())) * looking;
    const double away_m = 0.9 + 0.2 * u(random_);
    return {q * so3::exp(Eigen::Vector3d(0, 0, turn.z())),
            -away_m * (q * Eigen::Vector3d::UnitZ()) + 0.05 * Eigen::Vector3d(u(random_), 0, u(random_))};
  }

  BoardView view(const Pose& T_map_cam, double noise_px = 0) {
    std::normal_distribution<double> noise(0, 1);
    BoardView out;
    for (const Eigen::Vector3d& p : lattice_.points) {
      const auto pixel = camera_->project(T_map_cam.inverse() * p);
      EXPECT_TRUE(pixel.has_value());
      out.pixels.push_back(*pixel + noise_px * Eigen::Vector2d(noise(random_), noise(random_)));
    }
    return out;
  }

  std::shared_ptr<const Camera> camera_;
  BoardLattice lattice_;
  std::mt19937 random_{7};
};

TEST_F(BoardBefore, HomographyGivesThePose) {
  for (int i = 0; i < 20; ++i) {
    const Pose truth = pose();
    const auto found = pose_before_board(*camera_, lattice_, view(truth).pixels);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(found->minus(truth).norm(), 1e-6);
  }
}

TEST_F(BoardBefore, LeastSquaresInTheImageIsTheBestPose) {
  const auto squares = [&](const Pose& pose, const LatticePixels& pixels) {
    double sum = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i)
      sum += (*camera_->project(pose.inverse() * lattice_.points[i]) - pixels[i]).squaredNorm();
    return sum;
  };
  const LatticePixels pixels = view(pose(), 1.0).pixels;
  const auto best = best_pose_before_board(*camera_, lattice_, pixels);
  ASSERT_TRUE(best.has_value());
  EXPECT_LT(squares(*best, pixels), squares(*pose_before_board(*camera_, lattice_, pixels), pixels));
  for (int i = 0; i < 6; ++i)
    for (const double step : {1e-4, -1e-4})
      EXPECT_LT(squares(*best, pixels), squares(best->plus(step * Vector6d::Unit(i)), pixels));
}

TEST_F(BoardBefore, CameraAndPosesComeOutOfADataSheet) {
  std::vector<BoardView> views;
  std::vector<Pose> truth;
  for (int i = 0; i < 12; ++i) {
    truth.push_back(pose());
    views.push_back(view(truth.back()));
  }
  // Nearly without a prior, which would hold what the points tell weakly.
  const auto found = fit_board_camera(data_sheet(), 1e8 * known_roughly(), lattice_, &views);
  ASSERT_TRUE(found.ok()) << found.error().line();
  const CameraIntrinsics camera = corrected(data_sheet(), found->correction);
  EXPECT_NEAR(camera.fx, kTruth.fx, 1e-2);
  EXPECT_NEAR(camera.fy, kTruth.fy, 1e-2);
  EXPECT_NEAR(camera.cx, kTruth.cx, 1e-2);
  EXPECT_NEAR(camera.cy, kTruth.cy, 1e-2);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(camera.distortion[i], kTruth.distortion[i], 1e-3);
  ASSERT_EQ(views.size(), truth.size());
  for (std::size_t i = 0; i < views.size(); ++i) EXPECT_LT(views[i].T_map_cam.minus(truth[i]).norm(), 1e-3);
}

TEST_F(BoardBefore, ErrorsAreWithinTheirSigma) {
  double nees = 0;
  constexpr int kDraws = 10;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<BoardView> views;
    for (int i = 0; i < 12; ++i) views.push_back(view(pose(), 0.5));
    const auto found = fit_board_camera(data_sheet(), 1e2 * known_roughly(), lattice_, &views);
    ASSERT_TRUE(found.ok()) << found.error().line();
    const CameraIntrinsics camera = corrected(data_sheet(), found->correction);
    Eigen::VectorXd error(8);
    error << camera.fx - kTruth.fx, camera.fy - kTruth.fy, camera.cx - kTruth.cx, camera.cy - kTruth.cy,
        camera.distortion[0] - kTruth.distortion[0], camera.distortion[1] - kTruth.distortion[1],
        camera.distortion[2] - kTruth.distortion[2], camera.distortion[3] - kTruth.distortion[3];
    nees += error.cwiseQuotient(found->sigma).squaredNorm() / 8;
  }
  EXPECT_GT(nees / kDraws, 0.5);
  EXPECT_LT(nees / kDraws, 1.7);
}

TEST_F(BoardBefore, AViewOfSomethingElseIsTakenOut) {
  std::vector<BoardView> views;
  for (int i = 0; i < 6; ++i) views.push_back(view(pose()));
  BoardView wrong = view(pose());
  for (std::size_t i = 0; i < wrong.pixels.size(); i += 2) wrong.pixels[i].x() += 15;
  views.insert(views.begin() + 3, wrong);
  const auto found = fit_board_camera(data_sheet(), known_roughly(), lattice_, &views);
  ASSERT_TRUE(found.ok()) << found.error().line();
  EXPECT_EQ(views.size(), 6u);
  EXPECT_LT(found->rms_px, 0.05);
}

TEST_F(BoardBefore, PointsThatAreNotSeenDoNotCount) {
  std::vector<BoardView> views;
  std::vector<Pose> truth;
  for (int i = 0; i < 12; ++i) {
    truth.push_back(pose());
    views.push_back(view(truth.back()));
    for (std::size_t k = i % 3; k < views.back().pixels.size(); k += 3)
      views.back().pixels[k].setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  const auto found = fit_board_camera(data_sheet(), 1e8 * known_roughly(), lattice_, &views);
  ASSERT_TRUE(found.ok()) << found.error().line();
  EXPECT_NEAR(corrected(data_sheet(), found->correction).fx, kTruth.fx, 1e-2);
  for (std::size_t i = 0; i < views.size(); ++i) EXPECT_LT(views[i].T_map_cam.minus(truth[i]).norm(), 1e-3);
}

TEST_F(BoardBefore, TooFewViewsAreAnError) {
  std::vector<BoardView> views{view(pose()), view(pose())};
  const auto found = fit_board_camera(data_sheet(), known_roughly(), lattice_, &views);
  ASSERT_FALSE(found.ok());
  EXPECT_NE(found.error().line().find("2 pictures"), std::string::npos) << found.error().line();
}

}  // namespace
}  // namespace evpose
