// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/recording/handed_over.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "evpose/io/calibration/calibration.h"

namespace evpose::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

CalibratedCamera camera() {
  CalibratedCamera c;
  c.intrinsics = CameraIntrinsics{400, 401, 320, 240, "radtan", {-0.1, 0.02, 5e-4, -3e-4}, {640, 480}};
  c.T_cam_imu = Pose{so3::exp({0.3, -1.2, 0.5}), {0.1, 0.2, -0.3}};
  c.has_timeshift = true;
  c.timeshift_cam_imu_s = 0.01;
  return c;
}

// All numbers of one draw, in units of the ordinary calibration's sigmas.
std::array<double, 14> ordinary_draw(std::uint64_t seed) {
  HandedOverConfig config;
  config.preset = CalibrationQuality::ordinary;
  const CalibrationErrors e = draw_calibration_errors(config, seed);
  return {e.focal / 0.003,
          e.centre_px[0],
          e.centre_px[1],
          e.distortion[0] / 0.01,
          e.distortion[1] / 0.02,
          e.distortion[2] / 0.0005,
          e.distortion[3] / 0.0005,
          e.rotation_rad.x() / (0.3 * kDegree),
          e.rotation_rad.y() / (0.3 * kDegree),
          e.rotation_rad.z() / (0.3 * kDegree),
          e.translation_m.x() / 0.01,
          e.translation_m.y() / 0.01,
          e.translation_m.z() / 0.01,
          e.time_s / 0.002};
}

TEST(HandedOver, DrawsHaveTheStatedSigmasAndAreIndependent) {
  constexpr int kSeeds = 3000;
  std::array<std::array<double, 14>, 14> sums{};
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto draw = ordinary_draw(static_cast<std::uint64_t>(seed));
    for (std::size_t i = 0; i < 14; ++i)
      for (std::size_t j = 0; j < 14; ++j) sums[i][j] += draw[i] * draw[j] / kSeeds;
  }
  for (std::size_t i = 0; i < 14; ++i)
    for (std::size_t j = 0; j < 14; ++j)
      EXPECT_NEAR(sums[i][j], i == j ? 1 : 0, 4.5 * std::sqrt((i == j ? 2.0 : 1.0) / kSeeds))
          << i << " " << j;
}

TEST(HandedOver, TheFileStatesTheSpreadOfItsErrors) {
  constexpr int kSeeds = 2000;
  HandedOverConfig config;
  config.preset = CalibrationQuality::ordinary;
  const CalibratedCamera truth = camera();
  const CalibrationSigma stated = stated_sigma(config, *truth.intrinsics);
  const Eigen::VectorXd of_numbers = stated.of_intrinsics(*truth.intrinsics);
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(of_numbers.size() + 7);
  for (int seed = 0; seed < kSeeds; ++seed) {
    const CalibratedCamera wrong =
        with_errors(truth, draw_calibration_errors(config, static_cast<std::uint64_t>(seed)));
    const CameraIntrinsics &a = *truth.intrinsics, &b = *wrong.intrinsics;
    Eigen::VectorXd z(sums.size());
    z.head<4>() << b.fx - a.fx, b.fy - a.fy, b.cx - a.cx, b.cy - a.cy;
    for (std::size_t i = 0; i < 4; ++i)
      z(static_cast<Eigen::Index>(i) + 4) = b.distortion[i] - a.distortion[i];
    z.head<8>().array() /= of_numbers.array();
    const Pose given = wrong.T_cam_imu->inverse(), is = truth.T_cam_imu->inverse();
    z.segment<3>(8) = so3::log(given.q * is.q.conjugate()).cwiseQuotient(*stated.rotation_rad);
    z.segment<3>(11) = (given.p - is.p).cwiseQuotient(*stated.translation_m);
    z(14) = (wrong.timeshift_cam_imu_s - truth.timeshift_cam_imu_s) / *stated.time_s;
    sums += z.cwiseAbs2() / kSeeds;
  }
  for (const double mean_square : sums) EXPECT_NEAR(mean_square, 1, 4.5 * std::sqrt(2.0 / kSeeds));
  EXPECT_EQ(stated_sigma({}, *truth.intrinsics).of_intrinsics(*truth.intrinsics).norm(), 0) << "known";
}

TEST(HandedOver, TheSeedSelectsAndTruthIsNoError) {
  EXPECT_EQ(ordinary_draw(4), ordinary_draw(4));
  EXPECT_NE(ordinary_draw(4), ordinary_draw(5));
  EXPECT_TRUE(draw_calibration_errors({}, 4).none());
  HandedOverConfig only_time;
  only_time.time_sigma_ms = 3;
  const CalibrationErrors e = draw_calibration_errors(only_time, 4);
  EXPECT_FALSE(e.none());
  EXPECT_EQ(e.focal, 0);
  EXPECT_EQ(e.rotation_rad.norm(), 0);
}

TEST(HandedOver, ErrorsAreAddedToTheTruth) {
  HandedOverConfig config;
  config.preset = CalibrationQuality::ordinary;
  const CalibrationErrors e = draw_calibration_errors(config, 8);
  const CalibratedCamera truth = camera(), wrong = with_errors(truth, e);
  EXPECT_NEAR(wrong.intrinsics->fx / truth.intrinsics->fx - 1, e.focal, 1e-12);
  EXPECT_NEAR(wrong.intrinsics->fy / truth.intrinsics->fy - 1, e.focal, 1e-12);
  EXPECT_NEAR(wrong.intrinsics->cy - truth.intrinsics->cy, e.centre_px[1], 1e-12);
  EXPECT_NEAR(wrong.intrinsics->distortion[3] - truth.intrinsics->distortion[3], e.distortion[3], 1e-12);
  EXPECT_NEAR(wrong.timeshift_cam_imu_s - truth.timeshift_cam_imu_s, e.time_s, 1e-12);
  const Pose a = truth.T_cam_imu->inverse(), b = wrong.T_cam_imu->inverse();
  EXPECT_LT((b.p - a.p - e.translation_m).norm(), 1e-12);
  EXPECT_LT((so3::log(a.q.conjugate() * b.q) - e.rotation_rad).norm(), 1e-9);
  EXPECT_EQ(wrong.intrinsics->size, truth.intrinsics->size);
  const CalibratedCamera same = with_errors(truth, {});
  EXPECT_EQ(same.intrinsics->fx, truth.intrinsics->fx);
  EXPECT_LT(same.T_cam_imu->minus(*truth.T_cam_imu).norm(), 1e-12);
}

}  // namespace
}  // namespace evpose::sim
