// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/imu/strapdown.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

const Eigen::Vector3d kGravity(0, 0, -9.81);

/// A body on a circle of radius 2 m at 1 rad/s, heading along its velocity, which also climbs: known in
/// closed form.
struct Circle {
  static NavState state(double t) {
    NavState s;
    s.T_map_body.q = so3::exp(Eigen::Vector3d(0, 0, t + M_PI_2));
    s.T_map_body.p = {2 * std::cos(t), 2 * std::sin(t), 0.3 * t};
    s.velocity = {-2 * std::sin(t), 2 * std::cos(t), 0.3};
    return s;
  }
  static ImuSample sample(TimeNs t) {
    // Centripetal acceleration of 2 m/s^2 points to the body's left (+y).
    return {t, {0, 0, 1}, {0, 2, 9.81}};
  }
};

double position_error_after(double seconds, TimeNs step) {
  NavState s = Circle::state(0);
  const TimeNs end = from_seconds(seconds);
  for (TimeNs t = 0; t < end; t += step)
    s = strapdown(s, Circle::sample(t), Circle::sample(t + step), {0, 0, 0}, {0, 0, 0}, kGravity);
  return (s.T_map_body.p - Circle::state(seconds).T_map_body.p).norm();
}

TEST(Strapdown, FollowsACircleAndItsErrorFallsWithTheFourthPowerOfTheStep) {
  const double coarse = position_error_after(2, 200 * kNsPerMs);
  const double fine = position_error_after(2, 100 * kNsPerMs);
  EXPECT_LT(coarse, 1e-4);
  EXPECT_NEAR(coarse / fine, 16.0, 1.0);
}

TEST(Strapdown, BiasesAreTakenOff) {
  const Eigen::Vector3d bg(0.01, -0.02, 0.03), ba(0.1, 0.2, -0.3);
  ImuSample a = Circle::sample(0), b = Circle::sample(kNsPerMs);
  const NavState clean = strapdown(Circle::state(0), a, b, {0, 0, 0}, {0, 0, 0}, kGravity);
  for (ImuSample* s : {&a, &b}) s->gyro += bg, s->accel += ba;
  const NavState biased = strapdown(Circle::state(0), a, b, bg, ba, kGravity);
  EXPECT_LT(biased.T_map_body.minus(clean.T_map_body).norm(), 1e-15);
  EXPECT_LT((biased.velocity - clean.velocity).norm(), 1e-15);
}

TEST(Strapdown, JoinedIncrementsMoveAStateAsItsStepsDo) {
  ImuIncrement all;
  NavState by_steps = Circle::state(0);
  const Eigen::Vector3d bg(0.01, -0.02, 0.03), ba(0.1, 0.2, -0.3);
  for (TimeNs t = 0; t < from_seconds(0.1); t += kNsPerMs) {
    all = joined(all, integrate(Circle::sample(t), Circle::sample(t + kNsPerMs), bg, ba));
    by_steps = strapdown(by_steps, Circle::sample(t), Circle::sample(t + kNsPerMs), bg, ba, kGravity);
  }
  const NavState s = Circle::state(0);
  EXPECT_NEAR(all.dt_s, 0.1, 1e-12);
  const Eigen::Vector3d p = s.T_map_body.p + 0.1 * s.velocity + 0.005 * kGravity + s.T_map_body.q * all.dp;
  EXPECT_LT((p - by_steps.T_map_body.p).norm(), 1e-12);
  EXPECT_LT((s.velocity + 0.1 * kGravity + s.T_map_body.q * all.dv - by_steps.velocity).norm(), 1e-12);
  EXPECT_LT(so3::log((s.T_map_body.q * all.dq).conjugate() * by_steps.T_map_body.q).norm(), 1e-12);
}

TEST(Strapdown, AtRestNothingMoves) {
  const ImuSample a{0, {0, 0, 0}, {0, 0, 9.81}}, b{kNsPerS, {0, 0, 0}, {0, 0, 9.81}};
  const NavState s = strapdown({}, a, b, {0, 0, 0}, {0, 0, 0}, kGravity);
  EXPECT_LT(s.T_map_body.minus({}).norm(), 1e-14);
}

TEST(ImuSample, InterpolationMeetsItsEndsAndTheMiddle) {
  const ImuSample a{1000, {1, 2, 3}, {4, 5, 6}}, b{3000, {3, 2, 1}, {0, 5, 8}};
  EXPECT_EQ(interpolate(a, b, 1000).gyro, a.gyro);
  EXPECT_EQ(interpolate(a, b, 3000).accel, b.accel);
  EXPECT_EQ(interpolate(a, b, 2000).gyro, Eigen::Vector3d(2, 2, 2));
  EXPECT_EQ(interpolate(a, b, 2000).t, 2000);
}

}  // namespace
}  // namespace evpose
