// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/residual_field.h"

#include <gtest/gtest.h>

#include <random>

#include "evpose/calibrate/data_sheet.h"

namespace evpose {
namespace {

const CameraIntrinsics kCamera{381, 381, 320, 240, "radtan", {-0.1, 0.02, 0, 0}, {640, 480}};

std::shared_ptr<const Camera> with(double focal, double cx) {
  CameraIntrinsics c = kCamera;
  c.fx = c.fy = focal, c.cx = cx;
  return *make_camera(c);
}

TEST(ModelDifference, ATurnOfTheCameraIsNone) {
  // A small error of the principal point is a turn, but for its second order and the distortion.
  EXPECT_LT(rms_px(model_difference(*with(381, 321), *with(381, 320))), 0.5);
  EXPECT_NEAR(rms_px(model_difference(*with(381, 320), *with(381, 320))), 0, 1e-6);
}

TEST(ModelDifference, AFocalLengthIsRadial) {
  const auto arrows = model_difference(*with(381 * 1.01, 320), *with(381, 320));
  ASSERT_GT(arrows.size(), 300U);
  for (const FieldArrow& a : arrows) {
    const Eigen::Vector2d out = a.pixel - Eigen::Vector2d(320, 240);
    EXPECT_NEAR((a.offset_px - 0.01 * out).norm(), 0, 0.05);
  }
}

TEST(ResidualField, TellsAnOffsetFromContoursOfAllDirections) {
  const auto camera = *make_camera(kCamera);
  const Eigen::Vector2d offset(0.2, -0.1);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> turn(0, M_PI), x(-0.7, 0.7), y(-0.5, 0.5);
  ResidualField field(kCamera.size);
  std::vector<ContourOffset> contours;
  for (int i = 0; i < 20000; ++i) {
    const double a = turn(random);
    ContourOffset c{{x(random), y(random), 1}, Eigen::Vector3d::UnitX(), 0, 4};
    c.normal_px = {std::cos(a), std::sin(a)};
    c.offset_px = -offset.dot(c.normal_px);  // the contour should move back
    contours.push_back(c);
  }
  field.add(contours, *camera, {});
  EXPECT_GT(field.arrows().size(), 50U);
  for (const FieldArrow& a : field.arrows()) EXPECT_NEAR((a.offset_px - offset).norm(), 0, 1e-9);
  EXPECT_GT(field.coverage(), 0.5);
}

TEST(DataSheet, StatesWideSigmasWhereNothingIsStated) {
  CalibrationSigma stated;
  stated.time_s = 0;
  stated.distortion = {1e-3, 1e-3, 1e-4, 1e-4};
  const CalibrationSigma wide = data_sheet_sigma(stated, kCamera);
  EXPECT_EQ(wide.time_s, 0);
  EXPECT_EQ(wide.distortion, stated.distortion);
  EXPECT_NEAR((*wide.intrinsics)[0], 0.05 * 381, 1e-9);
  const Eigen::MatrixXd R = wide.of_correlation(kCamera);
  const double sigma = (*wide.intrinsics)[0], difference = std::sqrt(2 * (1 - R(0, 1))) * sigma;
  EXPECT_NEAR(difference / 381, 5e-3, 1e-4);  // of the pixels' aspect
  EXPECT_GT((*only_data_sheet(stated, kCamera).distortion)[0], 0.05);
}

TEST(DataSheet, AnEquidistantLensIsOneOfAnyLenses) {
  const CalibrationSigma sigma = any_lens_sigma({}, kCamera);
  const Eigen::VectorXd s = sigma.of_intrinsics(kCamera);
  const Eigen::Matrix2d P = s.segment<2>(4).asDiagonal() * sigma.of_correlation(kCamera).block<2, 2>(4, 4) *
                            s.segment<2>(4).asDiagonal();
  const auto sigmas = [&](double k1, double k2) {
    const Eigen::Vector2d k(k1, k2);
    return std::sqrt(k.dot(P.ldlt().solve(k)));
  };
  EXPECT_LT(sigmas(-0.32, 0.12), 1);
  EXPECT_GT(sigmas(-0.32, -0.12), 1.5);  // folds back
  CalibrationSigma stated;
  stated.distortion = {1e-3, 1e-3, 1e-4, 1e-4};
  EXPECT_EQ(any_lens_sigma(stated, kCamera).distortion, stated.distortion);
}

}  // namespace
}  // namespace evpose
