// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/health.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evpose/tracker/imu_watch.h"

namespace evpose {
namespace {

class HealthLaws : public ::testing::Test {
 protected:
  HealthLaws() { monitor_.start(0); }
  Health step(bool accepted, double sigma_px = 0.1, const std::string& refused = "no events") {
    t_ += 10 * kNsPerMs;
    return monitor_.judge({t_, accepted, accepted ? "" : refused, searching_, sigma_px, ""}, &reason_);
  }
  HealthMonitor monitor_{HealthConfig{}};
  TimeNs t_ = 0;
  bool searching_ = false;
  std::string reason_;
};

TEST_F(HealthLaws, ASearchedPoseIsNotTracked) {
  searching_ = true;
  for (int i = 0; i < 10; ++i) EXPECT_EQ(step(false), Health::initialising);
  searching_ = false;
  for (int i = 0; i < 10; ++i) step(true);
  EXPECT_EQ(monitor_.state(), Health::tracking);
  searching_ = true;
  EXPECT_EQ(step(false, 0.1, "searching for the pose"), Health::lost);
  EXPECT_EQ(reason_, "searching for the pose");
}

TEST_F(HealthLaws, InitialisesThenTracksAndSaysWhyOnce) {
  EXPECT_EQ(step(true), Health::initialising);
  for (int i = 0; i < 4; ++i) step(true);
  EXPECT_EQ(monitor_.state(), Health::tracking);
  EXPECT_FALSE(reason_.empty());
  step(true);
  EXPECT_TRUE(reason_.empty()) << "a reason belongs to a change";
}

TEST_F(HealthLaws, SilenceDegradesAndRecovers) {
  for (int i = 0; i < 10; ++i) step(true);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(step(false), Health::tracking);
  EXPECT_EQ(step(false), Health::degraded);
  EXPECT_NE(reason_.find("no events"), std::string::npos);
  EXPECT_EQ(step(true), Health::tracking);
}

TEST_F(HealthLaws, GrowingCovarianceDegradesThenLoses) {
  for (int i = 0; i < 10; ++i) step(true);
  EXPECT_EQ(step(true, 3), Health::degraded);
  EXPECT_EQ(step(false, 9, "no map point in view"), Health::lost);
  EXPECT_NE(reason_.find("no map point in view"), std::string::npos);
}

TEST_F(HealthLaws, NotANumberIsLost) { EXPECT_EQ(step(true, std::nan("")), Health::lost); }

TEST_F(HealthLaws, WithoutAnyRegistrationItKeepsInitialising) {
  for (int i = 0; i < 100; ++i) EXPECT_EQ(step(false), Health::initialising);
}

TEST_F(HealthLaws, FaultOfTheImuIsNamed) {
  for (int i = 0; i < 10; ++i) step(true);
  EXPECT_EQ(monitor_.judge({t_ + 1, true, "", false, 0.1, "IMU stuck: gyroscope x"}, &reason_),
            Health::degraded);
  EXPECT_EQ(reason_, "IMU stuck: gyroscope x");
}

/// A watch that has seen 50 good samples at 1 kHz, the last at 49 ms.
class ImuWatchLaws : public ::testing::Test {
 protected:
  ImuWatchLaws() {
    for (int i = 0; i < 50; ++i) EXPECT_TRUE(watch_.take(good(i)));
    EXPECT_EQ(watch_.fault(49 * kNsPerMs), "");
  }
  static ImuSample good(int ms) {
    const double u = std::sin(0.9 * ms);  // no two readings alike
    return {ms * kNsPerMs, {0.1 + 0.01 * u, 0.2 - 0.02 * u, 0.03 * u}, {u, 0.5 * u, 9.81 + 0.1 * u}};
  }
  std::string fault(int ms) const { return watch_.fault(ms * kNsPerMs); }
  ImuWatch watch_{ImuWatchConfig{}};
};

TEST_F(ImuWatchLaws, GapIsNamedFromWhenItCouldBeKnownAndForgottenLater) {
  const auto after = watch_.take(good(80));
  ASSERT_TRUE(after);
  EXPECT_TRUE(after->suspect);
  EXPECT_EQ(fault(51), "");
  EXPECT_EQ(fault(54), "IMU samples are missing");
  EXPECT_EQ(fault(80), "IMU gap of 31 ms");
  EXPECT_EQ(fault(131), "");
  const auto next = watch_.take(good(81));
  ASSERT_TRUE(next);
  EXPECT_FALSE(next->suspect);
}

TEST_F(ImuWatchLaws, StuckAxisIsNamed) {
  for (int i = 50; i < 100; ++i) {
    ImuSample s = good(i);
    s.gyro.y() = 0.2;
    EXPECT_EQ(watch_.take(s)->suspect, i >= 69) << i;
  }
  EXPECT_EQ(fault(68), "");
  EXPECT_EQ(fault(69), "IMU stuck: gyroscope y");
}

TEST_F(ImuWatchLaws, SaturationIsNamedAtTheRangeAndBelowIt) {
  ImuSample s = good(50);
  s.accel.z() = 200;
  EXPECT_TRUE(watch_.take(s)->suspect);
  EXPECT_EQ(fault(50), "IMU saturated: accelerometer z");
  for (int i = 51; i < 55; ++i) {
    s = good(i);
    s.gyro.x() = 8.7;  // 500 deg/s, four times
    EXPECT_EQ(watch_.take(s)->suspect, i == 54) << i;
  }
  EXPECT_EQ(fault(54), "IMU saturated: gyroscope x");
}

TEST_F(ImuWatchLaws, TimeThatDoesNotAdvanceAndNoNumbersAreLeftOut) {
  EXPECT_FALSE(watch_.take(good(49)));
  EXPECT_EQ(fault(49), "IMU time stands still");
  ImuSample s = good(50);
  s.gyro.x() = std::nan("");
  EXPECT_FALSE(watch_.take(s));
  EXPECT_TRUE(watch_.take(good(51)));
  EXPECT_FALSE(watch_.take(good(20)));
  EXPECT_EQ(fault(51), "IMU time goes back");
}

TEST_F(ImuWatchLaws, WhatComesLaterDoesNotChangeWhatWasSaid) {
  const std::string before = fault(49);
  watch_.take(good(90));
  EXPECT_EQ(fault(49), before);
}

}  // namespace
}  // namespace evpose
