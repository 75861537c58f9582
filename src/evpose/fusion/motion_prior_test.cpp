// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/motion_prior.h"

#include <gtest/gtest.h>

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/window.h"

namespace evpose {
namespace {

using namespace error_state;

const MotionPrior kPrior(1.5, 1.2);

FusionState some_state() {
  FusionState s;
  s.nav.T_map_body = {so3::exp({0.3, -0.2, 1.1}), {1, 2, 3}};
  s.nav.velocity = {0.5, -1, 0.2};
  s.gyro_bias = {0.01, -0.02, 0.03};
  s.angular_rate = {0.8, -0.5, 1.4};
  return s;
}

FusionState some_later_state() {
  FusionState s = some_state();
  s.t = 40 * kNsPerMs;
  Vector15d d;
  d << 0.03, -0.05, 0.02, 0.2, -0.1, 0.15, 0.1, 0.3, -0.2, 0, 0, 0, 0, 0, 0;
  s.add(d);
  return s;
}

TEST(MotionPrior, IsMetByABodyThatNothingAccelerates) {
  const FusionState i = some_state();
  FusionState j = i;
  j.t = 50 * kNsPerMs;
  j.nav.T_map_body.p += 0.05 * i.nav.velocity;
  j.nav.T_map_body.q = i.nav.T_map_body.q * so3::exp(0.05 * i.angular_rate);
  EXPECT_LT(kPrior.residual(i, j).value.norm(), 1e-12);
  j.nav.velocity.x() += 0.1;
  EXPECT_NEAR(kPrior.residual(i, j).value(kV), 0.1, 1e-12);
}

TEST(MotionPrior, DerivativesMatchDifferences) {
  const FusionState i = some_state(), j = some_later_state();
  const MotionPrior::Residual r = kPrior.residual(i, j);
  for (int k = 0; k < 15; ++k) {
    const double h = 1e-6;
    const auto value = [&](double start, double end) {
      FusionState a = i, b = j;
      a.add(start * Vector15d::Unit(k));
      b.add(end * Vector15d::Unit(k));
      return kPrior.residual(a, b).value;
    };
    EXPECT_LT(((value(h, 0) - value(-h, 0)) / (2 * h) - r.by_start.col(k)).norm(), 1e-8) << k;
    EXPECT_LT(((value(0, h) - value(0, -h)) / (2 * h) - r.by_end.col(k)).norm(), 1e-8) << k;
  }
}

TEST(MotionPrior, TwoTimesInARowAreAsUncertainAsOneThatIsAsLong) {
  const double a = 0.003, b = 0.011;
  MotionPrior::Matrix9d F = MotionPrior::Matrix9d::Identity();
  F.block<3, 3>(kP, kV) = b * Eigen::Matrix3d::Identity();
  const MotionPrior::Matrix9d both = F * kPrior.covariance(a) * F.transpose() + kPrior.covariance(b);
  const MotionPrior::Matrix9d one = kPrior.covariance(a + b);
  for (int i : {0, 1, 2, 6, 7, 8})
    for (int j : {0, 1, 2, 6, 7, 8}) EXPECT_NEAR(both(i, j), one(i, j), 1e-12);
}

/// An IMU that reads only gravity, and states of a body that is measured to be elsewhere.
Preintegration steady_motion(const ImuNoise& noise) {
  Preintegration sum({0, 0, 0}, {0, 0, 0});
  sum.add({0, {0, 0, 0}, {0, 0, 9.81}}, {5 * kNsPerMs, {0, 0, 0}, {0, 0, 9.81}}, noise);
  return sum;
}

double velocity_sigma(const std::optional<MotionPrior>& prior, const ImuNoise& noise) {
  Window window({0, 0, -9.81}, prior);
  FusionState first;
  first.covariance.diagonal().setConstant(1e-4);
  window.start(first);
  const Preintegration motion = steady_motion(noise);
  for (int k = 1; k <= 10; ++k) {
    FusionState next = motion.predict(window.newest(), {0, 0, -9.81});
    next.t = k * 5 * kNsPerMs;
    window.add(motion, next, {}, next.nav.T_map_body);
    EXPECT_TRUE(window.fuse_newest());
  }
  return std::sqrt(window.newest().covariance(kV, kV));
}

TEST(MotionPrior, CountsBesideTheImuAccordingToItsNoise) {
  ImuNoise noisy;
  noisy.accel_density = 15;  // ten times the prior's
  EXPECT_LT(velocity_sigma(kPrior, noisy), 0.2 * velocity_sigma({}, noisy));
  const ImuNoise usual;
  EXPECT_NEAR(velocity_sigma(kPrior, usual) / velocity_sigma({}, usual), 1, 1e-2);
}

}  // namespace
}  // namespace evpose
