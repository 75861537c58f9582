// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/adjusted_camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evpose/camera/calibration_sigma.h"

namespace evpose {
namespace {

const CameraIntrinsics kCameras[] = {
    {381, 382, 322, 237, "radtan", {-0.1, 0.02, 5e-4, -3e-4}, {640, 480}},
    {763, 764, 642, 357, "radtan", {-0.3, 0.12, 1e-3, -2e-3, -0.02}, {1280, 720}},
    {226, 227, 170, 131, "equidistant", {-0.048, 0.011, -0.055, 0.022}, {346, 260}},
    {350, 351, 376, 240, "ds", {-0.24, 0.57}, {752, 480}},
    {400, 400, 320, 240, "none", {}, {640, 480}}};

std::shared_ptr<AdjustedCamera> adjusted(const CameraIntrinsics& c) {
  auto camera = AdjustedCamera::create(c);
  EXPECT_TRUE(camera.ok());
  return *camera;
}

const Eigen::Vector3d kPoints[] = {{0.3, -0.2, 1.1}, {-1.2, 0.8, 2.5}, {0, 0, 2}, {0.9, 0.6, 1.5}};

TEST(AdjustedCamera, AsGivenItIsTheCameraItself) {
  for (const CameraIntrinsics& c : kCameras) {
    const auto camera = adjusted(c);
    for (const Eigen::Vector3d& x : kPoints) EXPECT_EQ(*camera->project(x), *(*make_camera(c))->project(x));
  }
}

TEST(AdjustedCamera, DerivativesAreThoseOfCentralDifferences) {
  for (const CameraIntrinsics& c : kCameras) {
    const auto camera = adjusted(c);
    for (const Eigen::Vector3d& x : kPoints) {
      const auto got = camera->by_numbers(x);
      ASSERT_TRUE(got);
      for (Eigen::Index i = 0; i < got->cols(); ++i) {
        const auto at = [&](double d) {
          CameraIntrinsics moved = c;
          double* const first[] = {&moved.fx, &moved.fy, &moved.cx, &moved.cy};
          (i < 4 ? *first[i] : moved.distortion[static_cast<std::size_t>(i) - 4]) += d;
          return *(*make_camera(moved))->project(x);
        };
        const double step = i < 4 ? 1e-3 : 1e-6;
        const Eigen::Vector2d expected = (at(step) - at(-step)) / (2 * step);
        EXPECT_LT((got->col(i) - expected).norm(), 1e-4 * expected.norm() + 1e-5)
            << c.distortion_model << " number " << i;
      }
    }
  }
}

TEST(AdjustedCamera, ACorrectionMakesTheCameraOfTheSum) {
  const CameraIntrinsics& c = kCameras[0];
  const auto camera = adjusted(c);
  AdjustedCamera::Correction correction(8);
  correction << 1.2, -0.7, 2, -1, 0.01, -0.01, 2e-4, 1e-4;
  ASSERT_TRUE(camera->set_correction(correction));
  const CameraIntrinsics sum{382.2, 381.3, 324, 236, "radtan", {-0.09, 0.01, 7e-4, -2e-4}, {640, 480}};
  for (const Eigen::Vector3d& x : kPoints) {
    EXPECT_LT((*camera->project(x) - *(*make_camera(sum))->project(x)).norm(), 1e-9);
    EXPECT_EQ(*camera->given().project(x), *(*make_camera(c))->project(x));
  }
  // A small change need not be taken over, but never counts for more than it is said to.
  correction(2) += 1e-3;
  ASSERT_TRUE(camera->set_correction(correction));
  EXPECT_NEAR(camera->project({0, 0, 2})->x(), (*make_camera(sum))->project({0, 0, 2})->x() + 1e-3, 0.002);
}

TEST(AdjustedCamera, ACorrectionThatMakesNoCameraIsNotTaken) {
  const auto camera = adjusted(kCameras[0]);
  AdjustedCamera::Correction correction = AdjustedCamera::Correction::Zero(8);
  correction(0) = -500;
  EXPECT_FALSE(camera->set_correction(correction));
  EXPECT_EQ(camera->focal_px(), (*make_camera(kCameras[0]))->focal_px());
}

TEST(AdjustedCamera, OrdinarySigmasHaveTheOrderOfTheNumbers) {
  for (const CameraIntrinsics& c : kCameras) {
    const Eigen::VectorXd sigma = CalibrationSigma{}.of_intrinsics(c);
    ASSERT_EQ(static_cast<std::size_t>(sigma.size()), 4 + c.distortion.size());
    EXPECT_DOUBLE_EQ(sigma(1), 3e-3 * c.fy);
    EXPECT_GT(sigma.minCoeff(), 0);
  }
  EXPECT_DOUBLE_EQ(CalibrationSigma{}.of_intrinsics(kCameras[1])(7), 5e-4);
  EXPECT_DOUBLE_EQ(CalibrationSigma{}.of_intrinsics(kCameras[1])(8), 0.02);
}

TEST(AdjustedCamera, TheRatioOfFocalLengthsIsKnownWhateverTheirSigma) {
  const CameraIntrinsics& c = kCameras[1];
  const auto ratio_sigma = [&](double x, double y) {
    CalibrationSigma stated;
    stated.intrinsics = {x * c.fx, y * c.fy, 1, 1};
    const double r = stated.of_correlation(c)(0, 1);
    return std::sqrt(x * x + y * y - 2 * r * x * y);
  };
  EXPECT_NEAR(ratio_sigma(3e-3, 3e-3), 1e-3, 1e-12);
  EXPECT_NEAR(ratio_sigma(1e-3, 1.5e-3), 1e-3, 1e-12);
  EXPECT_NEAR(ratio_sigma(2e-4, 2e-4), std::sqrt(8e-8), 1e-12) << "no more than what is stated";
  EXPECT_EQ(CalibrationSigma::known(c).of_correlation(c)(0, 1), 0);
  CalibrationSigma independent;
  independent.correlation = Eigen::MatrixXd::Identity(4 + static_cast<Eigen::Index>(c.distortion.size()),
                                                      4 + static_cast<Eigen::Index>(c.distortion.size()));
  EXPECT_EQ(independent.of_correlation(c)(0, 1), 0);
}

}  // namespace
}  // namespace evpose
