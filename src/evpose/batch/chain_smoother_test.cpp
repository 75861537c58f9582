// SPDX-License-Identifier: BSD-3-Clause
// The smoother against dense least squares on the same chain.
#include "evpose/batch/chain_smoother.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace evpose {
namespace {

constexpr int kStates = 12, kParameters = 5, kLateParameter = 4;

/// A random chain with its dense normal equations, the parameters last.
class Chain : public ::testing::Test {
 protected:
  Chain() : H_(Eigen::MatrixXd::Zero(size(), size())), b_(Eigen::VectorXd::Zero(size())) {
    const Vector15d mean = random_matrix(15, 1);
    const Matrix15d covariance = random_covariance(15);
    smoother_.start(mean, covariance);
    H_.topLeftCorner<15, 15>() += covariance.inverse();
    b_.head<15>() += covariance.ldlt().solve(mean);
    measure(0);
    for (int k = 0; k + 1 < kStates; ++k) {
      move(k);
      measure(k + 1);
    }
    prior_.grow(kParameters);
    prior_.S = 4 * Eigen::MatrixXd::Identity(kParameters, kParameters);
    prior_.s = random_matrix(kParameters, 1);
    H_.bottomRightCorner(kParameters, kParameters) += prior_.S;
    b_.tail(kParameters) += prior_.s;
  }
  static int size() { return 15 * kStates + kParameters; }

  Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal_(random_); });
  }
  Eigen::MatrixXd random_covariance(Eigen::Index n) {
    const Eigen::MatrixXd A = random_matrix(n, n);
    return A * A.transpose() + Eigen::MatrixXd::Identity(n, n);
  }
  /// Of rank 3, as contours of one direction are. The last parameter enters late.
  void measure(int k) {
    ChainMeasurement m;
    m.parameters = k < kStates / 2 ? std::vector<int>{2, 0} : std::vector<int>{kLateParameter, 1};
    const Eigen::MatrixXd J = random_matrix(3, 8);
    const Eigen::VectorXd r = random_matrix(3, 1);
    m.information = J.transpose() * J;
    m.vector = J.transpose() * r;
    smoother_.measure(m);
    Eigen::MatrixXd full = Eigen::MatrixXd::Zero(3, size());
    full.middleCols<6>(15 * k) = J.leftCols<6>();
    for (int i = 0; i < 2; ++i)
      full.col(15 * kStates + m.parameters[static_cast<std::size_t>(i)]) = J.col(6 + i);
    H_ += full.transpose() * full;
    b_ += full.transpose() * r;
  }
  void move(int k) {
    const Matrix15d F = Matrix15d::Identity() + 0.2 * random_matrix(15, 15), Q = random_covariance(15);
    const Vector15d offset = random_matrix(15, 1);
    const Eigen::MatrixXd G = random_matrix(15, 4);
    smoother_.move(F, offset, Q, G);
    Eigen::MatrixXd full = Eigen::MatrixXd::Zero(15, size());
    full.middleCols<15>(15 * k) = -F;
    full.middleCols<15>(15 * (k + 1)).setIdentity();
    full.middleCols<4>(15 * kStates) = -G;
    const Eigen::MatrixXd weighed = full.transpose() * Q.inverse();
    H_ += weighed * full;
    b_ -= weighed * offset;
  }

  std::mt19937 random_{7};
  std::normal_distribution<double> normal_;
  Eigen::MatrixXd H_;
  Eigen::VectorXd b_;
  ChainSmoother smoother_;
  ParameterInformation prior_;
};

TEST_F(Chain, IsDenseLeastSquares) {
  const Eigen::VectorXd dense = H_.ldlt().solve(b_);
  const Eigen::MatrixXd dense_covariance = H_.inverse();
  ParameterInformation known = prior_;
  known.add(smoother_.parameters());
  const Eigen::MatrixXd z_covariance = known.S.inverse();
  const Eigen::VectorXd z = z_covariance * known.s;
  EXPECT_LT((z - dense.tail(kParameters)).norm(), 1e-9 * dense.norm());
  EXPECT_LT((z_covariance - dense_covariance.bottomRightCorner(kParameters, kParameters)).norm(), 1e-9);
  // What earlier states owe to parameters is kept in single precision.
  constexpr double kSingle = 1e-5;
  const auto smoothed = smoother_.smooth(z, z_covariance);
  ASSERT_EQ(smoothed.size(), kStates);
  for (int k = 0; k < kStates; ++k) {
    const auto& s = smoothed[static_cast<std::size_t>(k)];
    EXPECT_LT((s.mean - dense.segment<15>(15 * k)).norm(), kSingle * dense.norm()) << k;
    const auto covariance = dense_covariance.block<15, 15>(15 * k, 15 * k);
    EXPECT_LT((s.covariance - covariance).norm(), kSingle * covariance.norm()) << k;
  }
}

TEST(ChainSmoother, AStepWithoutNoiseJoinsTwoStates) {
  ChainSmoother smoother;
  smoother.start(Vector15d::Zero(), Matrix15d::Identity());
  smoother.move(Matrix15d::Identity(), Vector15d::Zero(), Matrix15d::Zero(), Eigen::MatrixXd(15, 0));
  ChainMeasurement m{3 * Eigen::MatrixXd::Identity(6, 6), 6 * Eigen::VectorXd::Ones(6), {}};
  smoother.measure(m);
  const auto smoothed = smoother.smooth(Eigen::VectorXd(0), Eigen::MatrixXd(0, 0));
  ASSERT_EQ(smoothed.size(), 2U);
  for (const auto& s : smoothed) {
    // Prior 0 +- 1, measurement 2 of information 3.
    EXPECT_NEAR(s.mean(0), 1.5, 1e-9);
    EXPECT_NEAR(s.covariance(0, 0), 0.25, 1e-9);
    EXPECT_NEAR(s.mean(9), 0, 1e-9);
    EXPECT_NEAR(s.covariance(9, 9), 1, 1e-9);
  }
}

TEST(ChainSmoother, WhatNothingTellsStaysAsItWas) {
  // A state without uncertainty, as an accelerometer's bias without an IMU.
  ChainSmoother smoother;
  Matrix15d covariance = Matrix15d::Identity();
  covariance.row(12).setZero();
  covariance.col(12).setZero();
  smoother.start(Vector15d::Unit(12), covariance);
  smoother.move(Matrix15d::Identity(), Vector15d::Zero(), Matrix15d::Zero(), Eigen::MatrixXd(15, 0));
  const auto smoothed = smoother.smooth(Eigen::VectorXd(0), Eigen::MatrixXd(0, 0));
  for (const auto& s : smoothed) {
    EXPECT_DOUBLE_EQ(s.mean(12), 1);
    EXPECT_DOUBLE_EQ(s.covariance(12, 12), 0);
    EXPECT_TRUE(s.covariance.allFinite());
  }
}

}  // namespace
}  // namespace evpose
