// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/view_agreement.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace evpose {
namespace {

constexpr int kNumbers = 5, kSize = 9 + kNumbers;
constexpr double kSince_s = 0.04, kVelocity_m_s = 0.3;

Eigen::VectorXd draw(std::mt19937& random, Eigen::Index size) {
  std::normal_distribution<double> normal;
  return Eigen::VectorXd::NullaryExpr(size, [&](Eigen::Index) { return normal(random); });
}

// One over another that was found before, both with errors of their own; the prior between them has a wrong
// velocity.
TEST(ViewAgreement, IsOneForOneViewWhoseVelocityWasNotKnown) {
  std::mt19937 random(3);
  const Eigen::MatrixXd root =
      1e-3 * Eigen::MatrixXd::NullaryExpr(kSize, kSize,
                                          [&](Eigen::Index, Eigen::Index) { return draw(random, 1)(0); });
  const Eigen::MatrixXd of_view = root * root.transpose();
  const Eigen::Matrix3d of_velocity = kVelocity_m_s * kVelocity_m_s * Eigen::Matrix3d::Identity();
  constexpr int kDraws = 4000;
  double mean = 0, without = 0, other = 0;
  for (int i = 0; i < kDraws; ++i) {
    Eigen::VectorXd before = root * draw(random, kSize), moved = root * draw(random, kSize);
    moved.head<3>() += kSince_s * kVelocity_m_s * draw(random, 3);
    before.segment<3>(6).setConstant(7);  // asked of neither
    mean += view_distance2(moved, before, of_view, of_velocity, kSince_s) / kDraws;
    without += view_distance2(moved, before, of_view, Eigen::Matrix3d::Zero(), kSince_s) / kDraws;
    moved(4) += 0.1;  // rad
    other += view_distance2(moved, before, of_view, of_velocity, kSince_s) / kDraws;
  }
  EXPECT_NEAR(mean, 1, 0.03);
  EXPECT_GT(without, 4);
  EXPECT_GT(other, 16);
}

}  // namespace
}  // namespace evpose
