// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/health.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "evpose/tracker/imu_agreement.h"
#include "evpose/tracker/imu_watch.h"

namespace evpose {
namespace {

bool suspect(const CheckedImu& checked) { return checked.trust == ImuTrust::suspect; }

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

TEST_F(HealthLaws, APoseThatIsNotVerifiedIsNotTracked) {
  Evidence evidence{t_, true, "", false, 0.1, "", "", false};
  for (int i = 0; i < 20; ++i) {
    evidence.t += 10 * kNsPerMs;
    EXPECT_EQ(monitor_.judge(evidence, &reason_), Health::initialising);
  }
  evidence.verified = true;
  EXPECT_EQ(monitor_.judge(evidence, &reason_), Health::tracking);
}

TEST_F(HealthLaws, AContradictedPoseIsDegradedThenLostWithAReasonEach) {
  for (int i = 0; i < 10; ++i) step(true);
  Evidence evidence{t_, true, "", false, 0.1, "", "", true, "not in this map"};
  EXPECT_EQ(monitor_.judge(evidence, &reason_), Health::degraded);
  EXPECT_EQ(reason_, "not in this map");
  evidence.hopeless = true;
  EXPECT_EQ(monitor_.judge(evidence, &reason_), Health::lost);
  EXPECT_EQ(reason_, "not in this map");
  EXPECT_EQ(monitor_.judge(evidence, &reason_), Health::lost);
  EXPECT_TRUE(reason_.empty());
}

TEST_F(HealthLaws, ASearchThatBecomesHopelessSaysSo) {
  Evidence evidence{t_, false, "searching for the pose", true, 0.1, "", ""};
  EXPECT_EQ(monitor_.judge(evidence, &reason_), Health::initialising);
  evidence.hopeless = true;
  evidence.contradicted = "not in this map";
  EXPECT_EQ(monitor_.judge(evidence, &reason_), Health::lost);
  EXPECT_EQ(reason_, "not in this map");
}

TEST_F(HealthLaws, SeveralPosesAreAmbiguousUntilThereIsOne) {
  Evidence several;
  several.searching = true;
  several.ambiguous = "two of them";
  EXPECT_EQ(monitor_.judge(several, &reason_), Health::ambiguous);
  EXPECT_EQ(reason_, "two of them");
  EXPECT_FALSE(has_pose(monitor_.state()));
  for (int i = 0; i < 10; ++i) step(true);
  EXPECT_EQ(monitor_.state(), Health::tracking);
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
    for (int i = 0; i < 50; ++i) EXPECT_TRUE(take(good(i)));
    EXPECT_EQ(watch_.fault(49 * kNsPerMs), "");
  }
  static ImuSample good(int ms) {
    const double u = std::sin(0.9 * ms);  // no two readings alike
    return {ms * kNsPerMs, {0.1 + 0.01 * u, 0.2 - 0.02 * u, 0.03 * u}, {u, 0.5 * u, 9.81 + 0.1 * u}};
  }
  std::string fault(int ms) const { return watch_.fault(ms * kNsPerMs); }
  /// What becomes of a sample that keeps none waiting.
  std::optional<CheckedImu> take(const ImuSample& s) {
    const auto out = watch_.take(s);
    EXPECT_LE(out.size(), 1U);
    return out.empty() ? std::nullopt : std::optional<CheckedImu>(out.front());
  }
  ImuWatch watch_{ImuWatchConfig{}};
};

TEST_F(ImuWatchLaws, GapIsNamedFromWhenItCouldBeKnownAndForgottenLater) {
  const auto after = take(good(80));
  ASSERT_TRUE(after);
  EXPECT_TRUE(suspect(*after));
  EXPECT_EQ(fault(51), "");
  EXPECT_EQ(fault(54), "IMU samples are missing");
  EXPECT_EQ(fault(80), "IMU gap of 31 ms");
  const auto next = take(good(81));
  ASSERT_TRUE(next);
  EXPECT_FALSE(suspect(*next));
  EXPECT_TRUE(next->doubted) << "was it a gap, or has the clock jumped?";
  for (int i = 82; i < 590; ++i) EXPECT_EQ(take(good(i))->doubted, i < 580) << i;
  EXPECT_EQ(fault(579), "IMU gap of 31 ms");
}

TEST_F(ImuWatchLaws, ALongGapIsAFaultToItsEnd) {
  take(good(250));
  for (int i = 54; i < 250; ++i) EXPECT_EQ(fault(i), "IMU samples are missing") << i;
  EXPECT_EQ(fault(51), "");
}

TEST_F(ImuWatchLaws, ATimeThatGoesBackIsDoubtedForAWhile) {
  EXPECT_FALSE(take(good(20)));
  EXPECT_TRUE(take(good(50))->doubted);
  EXPECT_EQ(fault(50), "IMU time goes back");
  for (int i = 51; i < 570; ++i) EXPECT_EQ(take(good(i))->doubted, i < 549) << i;
}

TEST_F(ImuWatchLaws, ASpikeWaitsForTheNextReadingAndIsFlattened) {
  ImuSample s = good(50);
  s.gyro.z() += 5;
  s.accel.x() -= 50;
  EXPECT_FALSE(take(s)) << "it may be the begin of a motion";
  const auto mended = watch_.take(good(51));
  ASSERT_EQ(mended.size(), 2U);
  EXPECT_TRUE(suspect(mended[0]));
  EXPECT_EQ(mended[0].sample.t, s.t);
  EXPECT_NEAR(mended[0].sample.gyro.z(), 0.5 * (good(49).gyro.z() + good(51).gyro.z()), 1e-12);
  EXPECT_NEAR(mended[0].sample.accel.x(), 0.5 * (good(49).accel.x() + good(51).accel.x()), 1e-12);
  EXPECT_EQ(mended[0].sample.gyro.x(), s.gyro.x()) << "the other axes are as good as ever";
  EXPECT_EQ(fault(50), "IMU spike: gyroscope z");
  EXPECT_FALSE(suspect(mended[1]));
  EXPECT_EQ(mended[1].sample.gyro, good(51).gyro);
}

TEST_F(ImuWatchLaws, TwoSpikesInARowAreNoMotion) {
  for (const double second : {5.0, -5.0}) {
    const int from = second > 0 ? 50 : 60;
    for (int i = 50; i < from; ++i) take(good(i));
    ImuSample a = good(from), b = good(from + 1);
    a.gyro.x() += 5;
    b.gyro.x() += second;
    EXPECT_FALSE(take(a));
    EXPECT_FALSE(take(b));
    const auto mended = watch_.take(good(from + 2));
    ASSERT_EQ(mended.size(), 3U);
    for (int k = 0; k < 3; ++k)
      EXPECT_LT(std::abs(mended[static_cast<std::size_t>(k)].sample.gyro.x()), 0.12) << k;
    EXPECT_TRUE(suspect(mended[0]) && suspect(mended[1]) && !suspect(mended[2]));
  }
}

TEST_F(ImuWatchLaws, AChangeThatStaysPassesUntouched) {
  std::vector<CheckedImu> passed;
  for (int i = 50; i < 60; ++i) {
    ImuSample s = good(i);
    s.gyro.x() += 3;
    for (const CheckedImu& checked : watch_.take(s)) passed.push_back(checked);
    EXPECT_EQ(passed.size(), i < 52 ? 0U : static_cast<std::size_t>(i - 49)) << i;
  }
  for (std::size_t k = 0; k < passed.size(); ++k) {
    EXPECT_EQ(passed[k].sample.gyro.x(), good(50 + static_cast<int>(k)).gyro.x() + 3) << k;
    EXPECT_FALSE(suspect(passed[k])) << k;
  }
  EXPECT_EQ(fault(60), "");
}

/// A violent start, read 200 times a second: 16 g that fade within 30 ms.
TEST(ImuWatch, HardAccelerationPassesUntouched) {
  ImuWatch watch({});
  const double readings[] = {155, 142, 111, 73, 38, 15, 4, -1, -1, -1};
  std::vector<double> passed;
  for (int i = 0; i < 10; ++i) {
    ImuSample s;
    s.t = i * 5'000'000;
    s.accel.x() = readings[i];
    for (const CheckedImu& checked : watch.take(s)) {
      EXPECT_FALSE(suspect(checked)) << i;
      passed.push_back(checked.sample.accel.x());
    }
  }
  EXPECT_EQ(passed, std::vector<double>(std::begin(readings), std::end(readings)));
}

TEST_F(ImuWatchLaws, VibrationIsNoSpike) {
  // Readings that jump by 20 m/s^2 from sample to sample, ever more from 50 ms on.
  for (int i = 50; i < 400; ++i) {
    ImuSample s = good(i);
    s.accel.z() += std::min(1.0, 0.02 * (i - 50)) * (i % 2 == 0 ? 10 : -10) * std::cos(0.37 * i);
    for (const CheckedImu& checked : watch_.take(s)) EXPECT_FALSE(suspect(checked)) << i;
  }
}
TEST_F(ImuWatchLaws, VibrationIsNoSpikeFromTheFirstReadingOn) {
  // Of 20 m/s^2 at 81 Hz, read at 200 Hz; whatever its phase at the begin.
  for (int phase = 0; phase < 12; ++phase) {
    ImuWatch watch{ImuWatchConfig{}};
    for (int i = 0; i < 60; ++i) {
      ImuSample s = good(i);
      s.t = from_seconds(0.005 * i);
      for (int axis = 0; axis < 3; ++axis)
        s.accel[axis] += 20 * std::sin(2 * std::numbers::pi * (81 * 0.005 * i + phase / 12.0 + axis / 3.0));
      for (const CheckedImu& checked : watch.take(s)) EXPECT_FALSE(suspect(checked)) << phase << ", " << i;
    }
  }
}

TEST_F(ImuWatchLaws, StuckAxisIsNamed) {
  for (int i = 50; i < 100; ++i) {
    ImuSample s = good(i);
    s.gyro.y() = 0.2;
    EXPECT_EQ(suspect(*take(s)), i >= 61) << i;
  }
  EXPECT_EQ(fault(60), "");
  EXPECT_EQ(fault(61), "IMU stuck: gyroscope y");
}

TEST_F(ImuWatchLaws, SaturationIsNamedAtTheRangeAndBelowIt) {
  ImuSample s = good(50);
  s.accel.z() = 200;
  const auto mended = take(s);
  EXPECT_TRUE(suspect(*mended));
  EXPECT_EQ(mended->sample.accel.z(), good(49).accel.z()) << "a reading at the range is not integrated";
  EXPECT_EQ(fault(50), "IMU saturated: accelerometer z");
  // A turn that grows to 2.1 rad/s and is cut off there: the fourth equal reading tells.
  for (int i = 51; i < 64; ++i) {
    s = good(i);
    s.gyro.x() = std::min(2.1, 0.1 + 0.2 * (i - 50));
    EXPECT_EQ(suspect(*take(s)), i == 63) << i;
  }
  EXPECT_EQ(fault(63), "IMU saturated: gyroscope x");
}

TEST_F(ImuWatchLaws, TimeThatDoesNotAdvanceAndNoNumbersAreLeftOut) {
  EXPECT_FALSE(take(good(49)));
  EXPECT_EQ(fault(49), "IMU time stands still");
  ImuSample s = good(50);
  s.gyro.x() = std::nan("");
  EXPECT_FALSE(take(s));
  EXPECT_TRUE(take(good(51)));
  EXPECT_FALSE(take(good(20)));
  EXPECT_EQ(fault(51), "IMU time goes back");
}

/// A body that turns and is pushed about, its IMU with a late clock or a gyroscope of a wrong scale, and an
/// estimate led by the contours.
class AgreementLaws : public ::testing::Test {
 protected:
  static Eigen::Vector3d rate(double s) {
    return {0.6 * std::sin(5 * s), 0.4 * std::cos(3 * s), 0.3 * std::sin(4 * s)};
  }
  static Eigen::Vector3d push(double s) { return {2 * std::sin(6 * s), std::cos(4 * s), std::sin(7 * s)}; }
  /// Greatest difference in standard deviations, and the time at which the IMU was first distrusted, s.
  void run(double late_s, double scale, const Eigen::Vector3d& bias, bool absorb) {
    ImuAgreement agreement;
    const Eigen::Vector3d gravity(0, 0, -9.81);
    const ImuNoise noise{.accel_density = 3e-3, .gyro_density = 6e-4, .axes = {}};
    Eigen::Vector3d velocity(1, -2, 0.5);
    FusionState state;
    state.covariance.diagonal().segment<3>(error_state::kPhi).setConstant(rotation_sigma_ * rotation_sigma_);
    state.covariance.diagonal().segment<3>(error_state::kP).setConstant(1e-6);
    state.covariance.diagonal().segment<3>(error_state::kBg).setConstant(1e-6);
    state.covariance.diagonal().segment<3>(error_state::kBa).setConstant(1e-4);
    Eigen::Quaterniond late =
        Eigen::Quaterniond::Identity();  // the attitude that the late clock's forces had
    for (int i = 0; i < static_cast<int>(1e3 * late_s); ++i)
      late = late * so3::exp(-1e-3 * rate(-1e-3 * i - 5e-4));
    const auto force = [&](const Eigen::Quaterniond& q, double s) -> Eigen::Vector3d {
      return q.conjugate() * (push(s) - gravity) + bias;
    };
    for (int k = 1; k < 600; ++k) {
      const double s = 1e-3 * k;
      ImuSample a, b;
      a.t = (k - 1) * kNsPerMs, b.t = k * kNsPerMs;
      a.gyro = scale * rate(s - 1e-3 - late_s) + bias, b.gyro = scale * rate(s - late_s) + bias;
      a.accel = force(late, s - 1e-3 - late_s);
      late = (late * so3::exp(1e-3 * rate(s - 5e-4 - late_s))).normalized();
      b.accel = force(late, s - late_s);
      // An estimate that explains the difference away by a bias, or one that does not.
      state.gyro_bias = absorb ? Eigen::Vector3d(0.5 * (a.gyro + b.gyro) - rate(s - 5e-4)) : bias;
      state.accel_bias = bias;
      agreement.add_step(a, b, state, gravity, noise);
      state.nav.T_map_body.q = (state.nav.T_map_body.q * so3::exp(1e-3 * rate(s - 5e-4))).normalized();
      state.nav.T_map_body.p += 1e-3 * velocity + 5e-7 * push(s - 5e-4);
      velocity += 1e-3 * push(s - 5e-4);
      if (k % 3 != 0) continue;
      state.t = k * kNsPerMs;
      worst_ = std::max(worst_, agreement.judge(state, false));
      if (first_s_ < 0 && agreement.distrusted(state.t)) first_s_ = s;
    }
  }
  double worst_ = 0, first_s_ = -1, rotation_sigma_ = 3e-4;
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

TEST_F(AgreementLaws, ForcesTellALateClockWhenTurnsDoNot) {
  rotation_sigma_ = 1;
  run(0.1, 1, {0, 0, 0}, false);
  EXPECT_GT(first_s_, 0);
  EXPECT_LT(first_s_, 0.4);
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
  take(good(90));
  EXPECT_EQ(fault(49), before);
}

}  // namespace
}  // namespace evpose
