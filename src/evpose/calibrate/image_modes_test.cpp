// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/image_modes.h"

#include <gtest/gtest.h>

#include <random>

#include "evpose/calibrate/data_sheet.h"
#include "evpose/camera/adjusted_camera.h"
#include "evpose/core/pose.h"

namespace evpose {
namespace {

CameraIntrinsics camera() {
  CameraIntrinsics out;
  out.size = {320, 240};
  out.fx = 200;
  out.fy = 201;
  out.cx = 150;
  out.cy = 125;
  out.distortion_model = "radtan";
  out.distortion = {-0.05, 0.01, 0, 0};
  return out;
}

/// Pixels of rays over the given camera's image.
std::vector<Eigen::Vector2d> seen(const CameraIntrinsics& by, const Eigen::Matrix3d& R_cam_given) {
  const auto given = make_camera(camera()), other = make_camera(by);
  std::vector<Eigen::Vector2d> out;
  for (int y = 20; y < 240; y += 40)
    for (int x = 20; x < 320; x += 40) {
      const auto ray = (*given)->unproject({x, y});
      if (!ray) continue;
      const auto pixel = (*other)->project(R_cam_given * *ray);
      out.push_back(pixel.value_or(Eigen::Vector2d::Constant(1e3)));
    }
  return out;
}

double rms_px(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(a.size()));
}

TEST(ImageModes, MoveTheImageByUpToAPixel) {
  const ImageModes modes = image_modes(camera(), 8);
  const auto before = seen(camera(), Eigen::Matrix3d::Identity());
  for (const Eigen::VectorXd* mode : {&modes.focal, &modes.cx, &modes.cy, &modes.cubic, &modes.quintic}) {
    const auto after = seen(corrected(camera(), mode->head(8)), Eigen::Matrix3d::Identity());
    EXPECT_GT(rms_px(before, after), 0.1);
    EXPECT_LT(rms_px(before, after), 1.1);
  }
}

TEST(ImageModes, CovarianceOfFoundAllowsAllOfTheDataSheetButKeepsTheImage) {
  const CalibrationSigma given = data_sheet_sigma({}, camera());
  const Eigen::Quaterniond R_body_cam(so3::exp({1.2, -1.1, 0.9}));
  constexpr double kSigma_px = 2;
  Eigen::MatrixXd C = covariance_of_found(image_modes(camera(), 8), camera(), given, R_body_cam,
                                          {kSigma_px, kSigma_px, kSigma_px, kSigma_px});
  ASSERT_EQ(C.rows(), 15);
  EXPECT_LE(std::sqrt(C(8, 8)), given.of_rotation_rad().x());
  EXPECT_GT(std::sqrt(C(8, 8)), 0.7 * given.of_rotation_rad().x());
  EXPECT_GT(std::sqrt(C(2, 2)), 0.8 * 200 * given.of_rotation_rad().x()) << "a turn goes with the centre";
  C += 1e-16 * Eigen::MatrixXd::Identity(15, 15);
  const Eigen::MatrixXd root = C.llt().matrixL();
  const auto before = seen(camera(), Eigen::Matrix3d::Identity());
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double together = 0, apart = 0;
  constexpr int kDraws = 200;
  for (int k = 0; k < kDraws; ++k) {
    Eigen::VectorXd off = root * Eigen::VectorXd::NullaryExpr(15, [&] { return normal(random); });
    // No tangential terms, which are as given, and no turn about the optical axis, which no mode has told.
    off.segment<2>(6).setZero();
    const Eigen::Vector3d axis = R_body_cam * Eigen::Vector3d::UnitZ();
    off.segment<3>(8) -= off.segment<3>(8).dot(axis) * axis;
    const Eigen::Quaterniond turned = Eigen::Quaterniond(so3::exp(off.segment<3>(8))) * R_body_cam;
    const Eigen::Matrix3d R = (turned.conjugate() * R_body_cam).toRotationMatrix();
    together += std::pow(rms_px(before, seen(corrected(camera(), off.head(8)), R)), 2) / kDraws;
    apart += std::pow(rms_px(before, seen(camera(), R)), 2) / kDraws;
  }
  EXPECT_LT(std::sqrt(together), 2.5 * kSigma_px);
  EXPECT_GT(std::sqrt(apart), 3 * kSigma_px);
}

TEST(ImageModes, WhatIsKnownStaysKnown) {
  CalibrationSigma given = data_sheet_sigma({}, camera());
  given.distortion = std::vector<double>{0, 0, 0, 0};
  const Eigen::MatrixXd C = covariance_of_found(image_modes(camera(), 8), camera(), given,
                                                Eigen::Quaterniond::Identity(), {1, 1, 1, 1});
  EXPECT_TRUE(C.allFinite());
  EXPECT_LT(C.diagonal().segment<4>(4).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_LE(std::sqrt(C(0, 0)), 2.0) << "a focal length that moves the corner by a pixel";
}

}  // namespace
}  // namespace evpose
