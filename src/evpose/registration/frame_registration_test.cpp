// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/frame_registration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evpose/registration/test_frames.h"

namespace evpose {
namespace {

using test_frames::frame_of_line;
using test_frames::kFrameSize;
using test_frames::samples_of_line;
using test_frames::TestLine;

class FrameRegistrationOf : public ::testing::Test {
 protected:
  RegistrationResult measure(const Frame& frame, std::span<const ContourSample> samples, double age_s = 0,
                             double since_last_s = 1) {
    return registration_.measure({frame, age_s, since_last_s, samples, covariance_});
  }
  /// Weighted mean of the offsets that the last measurement asks for, px.
  double mean_offset() const {
    double sum = 0, weights = 0;
    for (const SampleOffset& o : registration_.offsets()) sum += o.weight * o.offset_px, weights += o.weight;
    return weights > 0 ? sum / weights : std::nan("");
  }
  void use(const FrameCamera& camera, int map_contrast = 0) {
    registration_ = FrameRegistration(kFrameSize, camera, std::vector<int>{map_contrast});
  }

  Matrix6d covariance_ = Matrix6d::Identity() * 0.01;
  FrameRegistration registration_{kFrameSize, {.gamma = 2.2}, std::vector<int>{0}};
};

TEST_F(FrameRegistrationOf, FindsEdgesAtRestToATwentiethOfAPixel) {
  for (const double angle : {0.0, 0.3, 0.8, 1.5})
    for (const double shift : {-0.8, -0.35, 0.0, 0.15, 0.6}) {
      const TestLine line{.angle = angle, .distance_px = angle < 1 ? 90.3 : 60.3};
      use({.gamma = 2.2});
      const RegistrationResult result = measure(frame_of_line(line, 2.2), samples_of_line(line, shift));
      ASSERT_GT(result.inliers, 10) << angle;
      EXPECT_NEAR(mean_offset(), shift, 0.05) << angle;
    }
}

TEST_F(FrameRegistrationOf, BlurredEdgesAreWhereTheyAreInTheMiddleOfTheExposure) {
  for (const double speed : {-900.0, 300.0, 1200.0}) {
    const TestLine line{.speed_px_s = speed};
    measure(frame_of_line(line, 2.2), samples_of_line(line, 0.4));
    EXPECT_NEAR(mean_offset(), 0.4, 0.1) << speed;
  }
}

TEST_F(FrameRegistrationOf, BlurredEdgesTellLess) {
  const TestLine still{}, moving{.speed_px_s = 1200};
  const double sharp = measure(frame_of_line(still, 2.2), samples_of_line(still, 0)).information(0, 0);
  const double blurred = measure(frame_of_line(moving, 2.2), samples_of_line(moving, 0)).information(0, 0);
  EXPECT_LT(blurred, 0.2 * sharp);
}

TEST_F(FrameRegistrationOf, IsCarriedToTheTimeOfTheSamples) {
  const TestLine line{.speed_px_s = 400};
  constexpr double kAge_s = 0.012;
  measure(frame_of_line(line, 2.2), samples_of_line(line, 0.3, kAge_s), kAge_s);
  EXPECT_NEAR(mean_offset(), 0.3, 0.1);
}

TEST_F(FrameRegistrationOf, RowsOfARollingShutterHaveTheirOwnTime) {
  constexpr double kRowTime_s = 1e-4;
  use({.gamma = 2.2, .row_time_s = kRowTime_s});
  const TestLine line{.speed_px_s = 300};
  const Frame frame = frame_of_line(line, 2.2, kRowTime_s);
  measure(frame, samples_of_line(line, 0.3));
  EXPECT_NEAR(mean_offset(), 0.3, 0.1);
  for (const SampleOffset& o : registration_.offsets()) EXPECT_NEAR(o.offset_px, 0.3, 0.25);
}

TEST_F(FrameRegistrationOf, ALinearSensorIsTakenAsOne) {
  use({.gamma = 1});
  const TestLine line{.speed_px_s = 800, .dark = 0.02};
  measure(frame_of_line(line, 1), samples_of_line(line, -0.4));
  EXPECT_NEAR(mean_offset(), -0.4, 0.1);
}

TEST_F(FrameRegistrationOf, EdgesOfTheWrongSignAreLeftOut) {
  const TestLine line{};  // brighter towards the normal
  const Frame frame = frame_of_line(line, 2.2);
  use({}, +1);
  EXPECT_GT(measure(frame, samples_of_line(line, 0)).inliers, 10);
  use({}, -1);
  EXPECT_EQ(measure(frame, samples_of_line(line, 0)).inliers, 0);
  use({}, 0);
  for (int i = 0; i < 10; ++i) measure(frame, samples_of_line(line, 0));
  EXPECT_EQ(registration_.contrast(0), 1);
}

TEST_F(FrameRegistrationOf, FramesInQuickSuccessionTellHardlyMoreThanOne) {
  const TestLine line{};
  const Frame frame = frame_of_line(line, 2.2);
  const auto samples = samples_of_line(line, 0);
  const double slow = measure(frame, samples, 0, 1.0).information(0, 0);
  const double fast = measure(frame, samples, 0, 0.01).information(0, 0);
  EXPECT_LT(50 * fast, 4 * slow);  // fifty frames in half a second
}

TEST_F(FrameRegistrationOf, AnEvenPictureTellsNothing) {
  const TestLine none{.dark = 0.3, .bright = 0.3};
  const RegistrationResult result = measure(frame_of_line(none, 2.2, 0, 2), samples_of_line(none, 0));
  EXPECT_LE(result.inliers, 1);
  EXPECT_FALSE(registration_.agrees());
}

TEST_F(FrameRegistrationOf, NoiseIsWithinTheStatedVariance) {
  const TestLine line{};
  const RegistrationResult result = measure(frame_of_line(line, 2.2, 0, 6), samples_of_line(line, 0));
  ASSERT_GT(result.inliers, 10);
  EXPECT_LT(std::abs(mean_offset()), 3 / std::sqrt(result.information(0, 0)));
}

}  // namespace
}  // namespace evpose
