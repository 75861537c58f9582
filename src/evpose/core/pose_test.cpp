// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/pose.h"

#include <gtest/gtest.h>

#include <random>
#include <unsupported/Eigen/MatrixFunctions>

namespace evpose {
namespace {

class PoseLaws : public ::testing::Test {
 protected:
  Eigen::Vector3d vector(double scale) {
    std::uniform_real_distribution<double> u(-scale, scale);
    return {u(random_), u(random_), u(random_)};
  }
  Pose pose() { return {so3::exp(vector(1.7)), vector(10)}; }
  std::mt19937 random_{7};
};

TEST_F(PoseLaws, ExpIsTheMatrixExponentialAtEveryScale) {
  for (double scale : {1e-12, 1e-7, 0.9e-4, 1.1e-4, 1e-2, 1.0, 3.0}) {
    const Eigen::Vector3d phi = vector(scale);
    const Eigen::Matrix3d expected = so3::hat(phi).exp();
    EXPECT_LT((so3::exp(phi).toRotationMatrix() - expected).norm(), 1e-13) << scale;
  }
}

TEST_F(PoseLaws, LogUndoesExpUpToPi) {
  for (double scale : {1e-12, 1e-6, 1e-3, 1.0, 1.8}) {
    const Eigen::Vector3d phi = vector(scale);
    EXPECT_LT((so3::log(so3::exp(phi)) - phi).norm(), 1e-13 * (1 + scale)) << scale;
  }
  const Eigen::Vector3d half_turn = M_PI * Eigen::Vector3d::UnitY();
  EXPECT_LT((so3::log(so3::exp(half_turn)) - half_turn).norm(), 1e-12);
}

TEST_F(PoseLaws, RightJacobianMatchesDifferences) {
  for (double scale : {1e-6, 5e-4, 0.1, 1.5}) {
    const Eigen::Vector3d phi = vector(scale);
    const Eigen::Matrix3d jacobian = so3::right_jacobian(phi);
    for (int k = 0; k < 3; ++k) {
      const double h = 1e-6;
      const Eigen::Vector3d d = h * Eigen::Vector3d::Unit(k);
      const Eigen::Vector3d column = (so3::log(so3::exp(phi).conjugate() * so3::exp(phi + d)) -
                                      so3::log(so3::exp(phi).conjugate() * so3::exp(phi - d))) /
                                     (2 * h);
      EXPECT_LT((column - jacobian.col(k)).norm(), 1e-8);
    }
    EXPECT_LT((jacobian * so3::right_jacobian_inverse(phi) - Eigen::Matrix3d::Identity()).norm(), 1e-9);
  }
}

TEST_F(PoseLaws, CompositionActsLikeMatrices) {
  const Pose a = pose(), b = pose();
  const Eigen::Vector3d x = vector(5);
  EXPECT_LT(((a * b).matrix() - a.matrix() * b.matrix()).norm(), 1e-12);
  EXPECT_LT((a.inverse() * (a * x) - x).norm(), 1e-12);
  EXPECT_LT((Pose::from_matrix(a.matrix()).matrix() - a.matrix()).norm(), 1e-12);
}

TEST_F(PoseLaws, MinusUndoesPlus) {
  const Pose a = pose();
  Vector6d d;
  d.head<3>() = vector(1);
  d.tail<3>() = vector(0.5);
  EXPECT_LT((a.plus(d).minus(a) - d).norm(), 1e-12);
}

TEST_F(PoseLaws, PlusRotatesInTheBodyAndTranslatesInTheMap) {
  const Pose a = pose();
  Vector6d d;
  d << 1, 0, 0, 0, 0, 0.1;
  const Pose moved = a.plus(d);
  EXPECT_LT((moved.p - a.p - Eigen::Vector3d::UnitX()).norm(), 1e-12);
  EXPECT_LT((a.q.conjugate() * moved.q * Eigen::Vector3d::UnitX() -
             Eigen::Vector3d(std::cos(0.1), std::sin(0.1), 0))
                .norm(),
            1e-12);
}

TEST_F(PoseLaws, InterpolationMeetsItsEndsAndTheMiddleOfAScrew) {
  const Pose a = pose();
  Vector6d d;
  d << 1, 2, 3, 0, 0.8, 0;
  const Pose b = a.plus(d);
  EXPECT_LT(interpolate(a, b, 0).minus(a).norm(), 1e-12);
  EXPECT_LT(interpolate(a, b, 1).minus(b).norm(), 1e-12);
  EXPECT_LT(interpolate(a, b, 0.5).minus(a.plus(0.5 * d)).norm(), 1e-12);
}

}  // namespace
}  // namespace evpose
