// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/held_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <random>

#include "evpose/core/pose.h"

namespace evpose {
namespace {

constexpr double kSpan_s = 1.0 / 300, kGathered = 0.9, kSpread = 0.4;
const Eigen::Quaterniond kLevel = Eigen::Quaterniond::Identity();

Matrix6d drawn(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Matrix6d a = Matrix6d::NullaryExpr([&] { return 1e-2 * normal(random); });
  return a * a.transpose() + 1e-8 * Matrix6d::Identity();
}

double least_eigenvalue(const Matrix6d& m) {
  return Eigen::SelfAdjointEigenSolver<Matrix6d>(m).eigenvalues()(0);
}

TEST(HeldCovariance, IsNeverBelowWhatTheFilterStates) {
  std::mt19937 random(1);
  HeldCovariance held;
  for (int i = 0; i < 200; ++i) {
    const Matrix6d P = drawn(random);
    const Matrix6d told = held.update(P, kLevel, i % 2 == 0 ? kGathered : kSpread, kSpan_s);
    EXPECT_GT(least_eigenvalue(told - P), -1e-10 * told.norm());
  }
}

TEST(HeldCovariance, EventsThatDoNotGatherMakeNothingBetterKnown) {
  std::mt19937 random(2);
  HeldCovariance held;
  Matrix6d before = Matrix6d::Zero();
  for (int i = 0; i < 50; ++i) {
    const Matrix6d told = held.update(drawn(random), kLevel, i % 2 == 0 ? kSpread : 0, kSpan_s);
    EXPECT_GT(least_eigenvalue(told - before), -1e-10 * told.norm());
    before = told;
  }
}

TEST(HeldCovariance, EventsThatGatherAreBelieved) {
  const Matrix6d P = 1e-6 * Matrix6d::Identity();
  HeldCovariance held;
  held.update(100 * P, kLevel, kSpread, kSpan_s);
  Matrix6d told;
  for (double t = 0; t < 1; t += kSpan_s) told = held.update(P, kLevel, kGathered, kSpan_s);
  EXPECT_LT((told - P).norm(), 0.01 * P.norm());
}

TEST(HeldCovariance, GrowsInTheDirectionAloneThatWasLessKnown) {
  Vector6d before = Vector6d::Constant(1e-6), now = before;
  before(2) = 25e-6, now(0) = 9e-6;
  HeldCovariance held;
  held.update(before.asDiagonal(), kLevel, kSpread, kSpan_s);
  const Matrix6d told = held.update(now.asDiagonal(), kLevel, kSpread, kSpan_s);
  Vector6d expected = now;
  expected(2) = before(2);
  EXPECT_LT((told - Matrix6d(expected.asDiagonal())).norm(), 1e-12);
}

/// An error about one axis of the map stays about that axis however the body turns.
TEST(HeldCovariance, StaysInTheMapWhereTheBodyTurns) {
  const double small = 1e-6, large = 1e-4;
  Matrix6d before = small * Matrix6d::Identity();
  before(3, 3) = large;
  HeldCovariance held;
  held.update(before, kLevel, kSpread, kSpan_s);
  const Eigen::Quaterniond quarter = so3::exp(Eigen::Vector3d(0, 0, M_PI / 2));
  const Matrix6d told = held.update(small * Matrix6d::Identity(), quarter, kSpread, kSpan_s);
  EXPECT_NEAR(told(4, 4), large, 1e-9);  // the map's x is the body's -y now
  EXPECT_NEAR(told(3, 3), small, 1e-9);
}

TEST(HeldCovariance, APoseFromElsewhereBeginsAnewWithItsOwnError) {
  const Matrix6d P = 1e-6 * Matrix6d::Identity();
  HeldCovariance held;
  held.update(100 * P, kLevel, kSpread, kSpan_s);
  held.restart(3e-3, 2e-3);
  Vector6d expected;
  expected << 10e-6, 10e-6, 10e-6, 5e-6, 5e-6, 5e-6;
  for (int i = 0; i < 3; ++i)
    EXPECT_LT((held.update(P, kLevel, kSpread, kSpan_s) - Matrix6d(expected.asDiagonal())).norm(), 1e-12);
}

}  // namespace
}  // namespace evpose
