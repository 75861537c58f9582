// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/piece_ekf.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "evpose/fusion/ekf.h"

namespace evpose {
namespace {

constexpr double kPieceSigma_m = 1e-3, kStartSigma_m = 5e-3, kStartSigma_rad = 2e-3;
constexpr double kWeight_px2 = 400;  // a twentieth of a pixel

FusionConfig some_config(int most_pieces = 100) {
  FusionConfig config;
  config.start_position_sigma_m = kStartSigma_m;
  config.start_rotation_sigma_rad = kStartSigma_rad;
  config.slow.piece_offset = PieceOffsets::on;
  config.slow.piece_sigma_m = kPieceSigma_m;
  config.slow.most_pieces = most_pieces;
  return config;
}

StatePropagator some_propagator() { return {MotionModel::imu, some_config(), ImuNoise{}}; }

NavState some_state() {
  NavState s;
  s.T_map_body = {so3::exp({0.3, -0.2, 1.1}), {1, 2, 3}};
  return s;
}

/// Contour samples around the body, several of each piece, and the direction in which their piece stands off.
std::vector<ContourOffset> some_contours(int pieces) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-1, 1);
  std::vector<ContourOffset> contours;
  for (int piece = 0; piece < pieces; ++piece) {
    const Eigen::Vector3d middle(2 * place(random), 2 * place(random), 3 + place(random));
    const Eigen::Vector3d across = Eigen::Vector3d(place(random), place(random), 0).normalized();
    for (int k = 0; k < 4; ++k)
      contours.push_back({middle + 0.05 * k * Eigen::Vector3d(-across.y(), across.x(), 0), 200.0 * across, 0,
                          kWeight_px2, static_cast<std::uint32_t>(10 * piece)});
  }
  return contours;
}

Vector6d by_pose(const ContourOffset& contour, const Pose& at) {
  Vector6d J;
  J << at.rotation() * contour.across_body, contour.point_body.cross(contour.across_body);
  return J;
}

/// The contours, and what a registration at the filter's pose makes of them.
void measure(BackEnd& filter, const std::vector<ContourOffset>& contours) {
  const Pose& at = filter.state().nav.T_map_body;
  filter.update(linearised(contours, at, at), contours);
}

TEST(PieceEkf, RepeatedMeasurementsGiveTheBatchSolutionOverPoseAndOffsets) {
  constexpr int kPieces = 9, kUpdates = 5;
  PieceEkf filter(some_propagator(), some_config().slow);
  filter.start(0, some_state(), {0, 0, 0});
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const Pose first = some_state().T_map_body;

  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(6 + kPieces, 6 + kPieces);
  information.diagonal() << Eigen::Vector3d::Constant(1 / (kStartSigma_m * kStartSigma_m)),
      Eigen::Vector3d::Constant(1 / (kStartSigma_rad * kStartSigma_rad)),
      Eigen::VectorXd::Constant(kPieces, 1 / (kPieceSigma_m * kPieceSigma_m));
  Eigen::VectorXd vector = Eigen::VectorXd::Zero(6 + kPieces);
  for (int update = 0; update < kUpdates; ++update) {
    auto contours = some_contours(kPieces);
    for (ContourOffset& contour : contours) {
      // What the contours ask for, from the first pose, is small, so that the turned axes do not matter.
      const double asked = 0.002 * normal(random);
      Eigen::VectorXd row = Eigen::VectorXd::Zero(6 + kPieces);
      row.head<6>() = by_pose(contour, first);
      row(6 + contour.piece / 10) = -contour.across_body.norm();
      information += contour.weight * row * row.transpose();
      vector += contour.weight * asked * row;
      // The filter is told from where it stands.
      contour.offset_px = asked - row.head<6>().dot(filter.state().nav.T_map_body.minus(first));
    }
    measure(filter, contours);
  }
  const Eigen::MatrixXd covariance = information.inverse();
  const Eigen::VectorXd expected = covariance * vector;
  const Vector6d got = filter.state().nav.T_map_body.minus(first);
  const Vector6d sigma = covariance.diagonal().head<6>().cwiseSqrt();
  EXPECT_LT((got - expected.head<6>()).cwiseQuotient(sigma).cwiseAbs().maxCoeff(), 2e-3);
  EXPECT_LT((filter.state().pose_covariance() - covariance.topLeftCorner(6, 6))
                .cwiseQuotient(sigma * sigma.transpose())
                .cwiseAbs()
                .maxCoeff(),
            2e-3);
  ASSERT_EQ(filter.pieces().size(), kPieces);
  for (int i = 0; i < kPieces; ++i) {
    const auto k = static_cast<std::size_t>(i);
    EXPECT_NEAR(filter.pieces()[k].offset_m, expected(6 + i), 2e-3 * filter.sigma_m(k)) << i;
    EXPECT_NEAR(filter.sigma_m(k), std::sqrt(covariance(6 + i, 6 + i)), 2e-3 * filter.sigma_m(k)) << i;
  }
}

TEST(PieceEkf, KnowsThatAMapWithPiecesOffNeverTellsMoreThanThePiecesAllow) {
  constexpr int kPieces = 12, kRuns = 300, kUpdates = 40;
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  double own = 0, plain = 0;
  const StatePropagator propagator = some_propagator();
  for (int run = 0; run < kRuns; ++run) {
    PieceEkf with(propagator, some_config().slow);
    Ekf without(propagator);
    NavState start = some_state();
    Vector6d off;
    for (int i = 0; i < 6; ++i) off(i) = normal(random) * (i < 3 ? kStartSigma_m : kStartSigma_rad);
    start.T_map_body = start.T_map_body.plus(off);
    with.start(0, start, {0, 0, 0});
    without.start(0, start, {0, 0, 0});
    std::vector<double> offsets(kPieces);
    for (double& offset : offsets) offset = kPieceSigma_m * normal(random);
    for (int update = 0; update < kUpdates; ++update)
      for (BackEnd* filter : {static_cast<BackEnd*>(&with), static_cast<BackEnd*>(&without)}) {
        auto contours = some_contours(kPieces);
        const Vector6d wrong = some_state().T_map_body.minus(filter->state().nav.T_map_body);
        for (ContourOffset& contour : contours)
          contour.offset_px = by_pose(contour, filter->state().nav.T_map_body).dot(wrong) -
                              contour.across_body.norm() * offsets[contour.piece / 10] +
                              normal(random) / std::sqrt(contour.weight);
        measure(*filter, contours);
      }
    const auto nees = [](const BackEnd& filter) {
      const Vector6d e = filter.state().nav.T_map_body.minus(some_state().T_map_body);
      return e.dot(filter.state().pose_covariance().ldlt().solve(e)) / 6;
    };
    own += nees(with) / kRuns;
    plain += nees(without) / kRuns;
  }
  EXPECT_NEAR(own, 1, 0.12);
  EXPECT_GT(plain, 20) << "or the pieces' offsets are too small to matter here";
}

TEST(PieceEkf, ThePieceNotSeenForLongestGivesWay) {
  PieceEkf filter(some_propagator(), some_config(2).slow);
  filter.start(0, some_state(), {0, 0, 0});
  const auto contours = some_contours(3);
  const auto numbers = [&] {
    std::vector<std::uint32_t> all;
    for (const auto& piece : filter.pieces()) all.push_back(piece.number);
    return all;
  };
  const auto see = [&](std::size_t from, std::size_t count) {
    const std::vector<ContourOffset> seen(contours.begin() + static_cast<std::ptrdiff_t>(4 * from),
                                          contours.begin() + static_cast<std::ptrdiff_t>(4 * (from + count)));
    measure(filter, seen);
  };
  const auto wait = [&](TimeNs t) {
    filter.predict({filter.state().t, {0, 0, 0}, {0, 0, 9.81}}, {t, {0, 0, 0}, {0, 0, 9.81}}, ImuTrust::good);
  };
  see(0, 3);
  EXPECT_EQ(numbers(), (std::vector<std::uint32_t>{0, 10})) << "the third finds no state";
  wait(150 * kNsPerMs);
  see(1, 1);
  wait(300 * kNsPerMs);
  see(2, 1);
  EXPECT_EQ(numbers(), (std::vector<std::uint32_t>{20, 10}));
  EXPECT_TRUE(filter.state().covariance.allFinite());
}

TEST(PieceEkf, IsTheFilterOfMapsThatStateErrorsUnlessMoreIsAskedFor) {
  FusionConfig config;
  EXPECT_EQ(*settled(config, true), PieceOffsets::on);
  EXPECT_EQ(*settled(config, false), PieceOffsets::off);
  config.calibration.rotation = true;
  EXPECT_EQ(*settled(config, true), PieceOffsets::off);
  config.slow.piece_offset = PieceOffsets::on;
  ASSERT_FALSE(settled(config, true).ok());
  EXPECT_NE(settled(config, true).error().line().find("fusion.slow.piece_offset"), std::string::npos);
  config.calibration.rotation = false;
  EXPECT_EQ(*settled(config, false), PieceOffsets::on);
}

}  // namespace
}  // namespace evpose
