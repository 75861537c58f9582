// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/health.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evpose/tracker/imu_agreement.h"
#include "evpose/tracker/imu_watch.h"

namespace evpose {
namespace {

class HealthLaws : public ::testing::Test {
 protected:
  HealthLaws() { monitor_.start(0); }
  Health step(bool accepted, double sigma_px = 0.1, const std::string& refused = "no events") {
    t_ += 10 * kNsPerMs;
    return monitor_.judge({t_, accepted, accepted ? "" : refused, searching_, sigma_px, "", ""}, &reason_);
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
  EXPECT_EQ(monitor_.judge({t_ + 1, true, "", false, 0.1, "", "IMU stuck: gyroscope x"}, &reason_),
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
  const auto next = watch_.take(good(81));
  ASSERT_TRUE(next);
  EXPECT_FALSE(next->suspect);
  EXPECT_TRUE(next->doubted) << "was it a gap, or has the clock jumped?";
  for (int i = 82; i < 340; ++i) EXPECT_EQ(watch_.take(good(i))->doubted, i < 330) << i;
  EXPECT_EQ(fault(329), "IMU gap of 31 ms");
}

TEST_F(ImuWatchLaws, ATimeThatGoesBackIsDoubtedForAWhile) {
  EXPECT_FALSE(watch_.take(good(20)));
  EXPECT_TRUE(watch_.take(good(50))->doubted);
  EXPECT_EQ(fault(50), "IMU time goes back");
  for (int i = 51; i < 320; ++i) EXPECT_EQ(watch_.take(good(i))->doubted, i < 299) << i;
}

TEST_F(ImuWatchLaws, ASpikeIsReplacedByTheLastGoodReading) {
  ImuSample s = good(50);
  s.gyro.z() += 5;
  s.accel.x() -= 50;
  const auto mended = watch_.take(s);
  ASSERT_TRUE(mended);
  EXPECT_TRUE(mended->suspect);
  EXPECT_EQ(mended->sample.gyro.z(), good(49).gyro.z());
  EXPECT_EQ(mended->sample.accel.x(), good(49).accel.x());
  EXPECT_EQ(mended->sample.gyro.x(), s.gyro.x()) << "the other axes are as good as ever";
  EXPECT_EQ(fault(50), "IMU spike: gyroscope z");
  const auto next = watch_.take(good(51));
  EXPECT_FALSE(next->suspect);
  EXPECT_EQ(next->sample.gyro, good(51).gyro);
}

TEST_F(ImuWatchLaws, AChangeThatStaysIsNoSpike) {
  for (int i = 50; i < 60; ++i) {
    ImuSample s = good(i);
    s.gyro.x() += 3;
    const auto mended = watch_.take(s);
    EXPECT_EQ(mended->sample.gyro == s.gyro, i >= 51) << i;
  }
}

/// A violent start: 16 g that fade within 30 ms, read 200 times a second.
TEST(ImuWatch, HardAccelerationIsNoSpike) {
  ImuWatch watch({});
  const double readings[] = {155, 142, 111, 73, 38, 15, 4, -1, -1, -1};
  for (int i = 0; i < 10; ++i) {
    ImuSample s;
    s.t = i * 5'000'000;
    s.accel.x() = readings[i];
    const auto mended = watch.take(s);
    ASSERT_TRUE(mended);
    EXPECT_EQ(mended->sample.accel.x(), readings[i]) << i;
  }
}

TEST_F(ImuWatchLaws, VibrationIsNoSpike) {
  // Readings that jump by 20 m/s^2 from sample to sample, ever more from 50 ms on.
  for (int i = 50; i < 400; ++i) {
    ImuSample s = good(i);
    s.accel.z() += std::min(1.0, 0.02 * (i - 50)) * (i % 2 == 0 ? 10 : -10) * std::cos(0.37 * i);
    EXPECT_FALSE(watch_.take(s)->suspect) << i;
  }
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
  const auto mended = watch_.take(s);
  EXPECT_TRUE(mended->suspect);
  EXPECT_EQ(mended->sample.accel.z(), good(49).accel.z()) << "a reading at the range is not integrated";
  EXPECT_EQ(fault(50), "IMU saturated: accelerometer z");
  // A turn that grows to 2.1 rad/s and is cut off there: the fourth equal reading tells.
  for (int i = 51; i < 64; ++i) {
    s = good(i);
    s.gyro.x() = std::min(2.1, 0.1 + 0.2 * (i - 50));
    EXPECT_EQ(watch_.take(s)->suspect, i == 63) << i;
  }
  EXPECT_EQ(fault(63), "IMU saturated: gyroscope x");
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

/// A turning body, its gyroscope with a late clock or a wrong scale, and an estimate led by the contours.
class AgreementLaws : public ::testing::Test {
 protected:
  static Eigen::Vector3d rate(double s) {
    return {0.6 * std::sin(5 * s), 0.4 * std::cos(3 * s), 0.3 * std::sin(4 * s)};
  }
  /// Greatest difference in standard deviations, and the time at which the IMU was first distrusted, s.
  void run(double late_s, double scale, const Eigen::Vector3d& bias, bool absorb) {
    ImuAgreement agreement{ImuAgreementConfig{}};
    FusionState state;
    state.covariance.diagonal().segment<3>(error_state::kPhi).setConstant(1e-7);
    state.covariance.diagonal().segment<3>(error_state::kBg).setConstant(1e-6);
    for (int k = 1; k < 600; ++k) {
      const double s = 1e-3 * k;
      ImuSample a, b;
      a.t = (k - 1) * kNsPerMs, b.t = k * kNsPerMs;
      a.gyro = scale * rate(s - 1e-3 - late_s) + bias, b.gyro = scale * rate(s - late_s) + bias;
      // An estimate that explains the difference away by a bias, or one that does not.
      state.gyro_bias = absorb ? Eigen::Vector3d(0.5 * (a.gyro + b.gyro) - rate(s - 5e-4)) : bias;
      agreement.turn(a, b, state.gyro_bias, 6e-4);
      state.nav.T_map_body.q = (state.nav.T_map_body.q * so3::exp(1e-3 * rate(s - 5e-4))).normalized();
      if (k % 3 != 0) continue;
      state.t = k * kNsPerMs;
      worst_ = std::max(worst_, agreement.judge(state));
      if (first_s_ < 0 && agreement.distrusted(state.t)) first_s_ = s;
    }
  }
  double worst_ = 0, first_s_ = -1;
};

TEST_F(AgreementLaws, ATrueGyroscopeAgreesWhateverItsKnownBias) {
  run(0, 1, {0.02, -0.01, 0.03}, false);
  EXPECT_LT(worst_, 0.1);
  EXPECT_LT(first_s_, 0);
}

TEST_F(AgreementLaws, ALateClockContradicts) {
  run(0.1, 1, {0, 0, 0}, false);
  EXPECT_GT(first_s_, 0);
  EXPECT_LT(first_s_, 0.1);
}

TEST_F(AgreementLaws, ABiasThatGivesWayDoesNotHideIt) {
  run(0.1, 1, {0, 0, 0}, true);
  EXPECT_GT(worst_, 2.5);
}

TEST_F(AgreementLaws, AWrongSignContradicts) {
  run(0, -1, {0, 0, 0}, false);
  EXPECT_GT(first_s_, 0);
}

TEST_F(ImuWatchLaws, WhatComesLaterDoesNotChangeWhatWasSaid) {
  const std::string before = fault(49);
  watch_.take(good(90));
  EXPECT_EQ(fault(49), before);
}

}  // namespace
}  // namespace evpose
