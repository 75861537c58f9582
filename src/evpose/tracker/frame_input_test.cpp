// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/frame_input.h"

#include <gtest/gtest.h>

#include "evpose/registration/test_frames.h"

namespace evpose {
namespace {

using test_frames::kFrameSize;
using test_frames::TestLine;

/// A body that moves along x with the line of the picture: a metre is a pixel, the line moves against it.
FusionState state_at(double t_s, double speed, double acceleration) {
  FusionState state;
  state.nav.T_map_body.p.x() = -(speed * t_s + 0.5 * acceleration * t_s * t_s);
  state.nav.velocity.x() = -(speed + acceleration * t_s);
  return state;
}

class FrameInputOf : public ::testing::Test {
 protected:
  /// Mean offset that a frame at t = 0 asks for when it is measured at `age_s`.
  double offset(const TestLine& line, double age_s, double shift_px) {
    constexpr double kPeriod_s = 1.0 / 300;
    for (double t_s = age_s - 20 * kPeriod_s; t_s < age_s - 1e-6; t_s += kPeriod_s)
      input_.remember(from_seconds(t_s), state_at(t_s, line.speed_px_s, line.acceleration_px_s2));
    TestLine now = line;  // where the contour is at the time of the update
    now.distance_px += line.speed_px_s * age_s + 0.5 * line.acceleration_px_s2 * age_s * age_s;
    now.speed_px_s += line.acceleration_px_s2 * age_s;
    const auto samples = test_frames::samples_of_line(now, shift_px);
    const FusionState state = state_at(age_s, line.speed_px_s, line.acceleration_px_s2);
    input_.add(test_frames::frame_of_line(line, 2.2));
    const auto result =
        input_.measure(from_seconds(age_s), {samples, Matrix6d::Identity() * 0.01, {}, state});
    EXPECT_TRUE(result.has_value());
    double sum = 0, weights = 0;
    for (const SampleOffset& o : input_.offsets()) sum += o.weight * o.offset_px, weights += o.weight;
    return weights > 0 ? sum / weights : std::nan("");
  }

  FrameInput input_{kFrameSize, {.gamma = 2.2}, std::vector<int>{0}};
};

TEST_F(FrameInputOf, AFrameIsMeasuredWhereThePoseWasInTheMiddleOfItsExposure) {
  EXPECT_NEAR(offset({.angle = 0, .speed_px_s = 200}, 0.02, 0.4), 0.4, 0.1);
}

TEST_F(FrameInputOf, ChangesOfTheMotionSinceThenAreKnown) {
  // By constant velocity alone it would be looked for 3 px from where it was.
  EXPECT_NEAR(offset({.angle = 0, .speed_px_s = 100, .acceleration_px_s2 = 15'000}, 0.02, 0.3), 0.3, 0.15);
}

TEST_F(FrameInputOf, IsTakenWhenItIsExposedAndOnce) {
  const TestLine line{.angle = 0};
  const auto samples = test_frames::samples_of_line(line, 0);
  const FusionState state = state_at(0, 0, 0);
  const FrameInput::Seen seen{samples, Matrix6d::Identity() * 0.01, {}, state};
  const Frame frame = test_frames::frame_of_line(line, 2.2);  // exposed for 10 ms
  input_.add(frame);
  EXPECT_FALSE(input_.measure(4 * kNsPerMs, seen).has_value());
  EXPECT_TRUE(input_.measure(6 * kNsPerMs, seen).has_value());
  EXPECT_FALSE(input_.measure(8 * kNsPerMs, seen).has_value());
  Frame late = frame;
  late.t = 1;
  input_.add(late);
  EXPECT_FALSE(input_.measure(500 * kNsPerMs, seen).has_value()) << "the motion since then is forgotten";
}

TEST_F(FrameInputOf, FramesThatAgreeConfirmThePose) {
  const TestLine line{.angle = 0};
  std::vector<ContourSample> samples = test_frames::samples_of_line(line, 0);
  const std::vector<ContourSample> once = samples;  // enough of them
  for (int i = 0; i < 3; ++i) samples.insert(samples.end(), once.begin(), once.end());
  const FusionState state = state_at(0, 0, 0);
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(input_.confirms(33 * i * kNsPerMs));
    Frame frame = test_frames::frame_of_line(line, 2.2);
    frame.t = 33 * i * kNsPerMs;
    input_.add(frame);
    input_.measure(frame.t + 6 * kNsPerMs, {samples, Matrix6d::Identity() * 0.01, {}, state});
  }
  EXPECT_TRUE(input_.confirms(105 * kNsPerMs));
  EXPECT_FALSE(input_.confirms(kNsPerS)) << "frames have stopped";
}

}  // namespace
}  // namespace evpose
