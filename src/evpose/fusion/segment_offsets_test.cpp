// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/segment_offsets.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "evpose/fusion/ekf.h"

namespace evpose {
namespace {

constexpr double kOffsetSigma_m = 1e-3, kStartSigma_m = 5e-3, kStartSigma_rad = 2e-3;
constexpr double kWeight_px2 = 400;  // a twentieth of a pixel
constexpr double kPxPerM = 200;      // in the image, of what the contours do in the map

FusionConfig some_config(int most_segments = 100) {
  FusionConfig config;
  config.start_position_sigma_m = kStartSigma_m;
  config.start_rotation_sigma_rad = kStartSigma_rad;
  config.segment_offsets = SegmentOffsetUse::on;
  config.segments.sigma_m = kOffsetSigma_m;
  config.segments.sigma_px = kOffsetSigma_m * kPxPerM;  // the contours below state no error
  config.segments.most = most_segments;
  return config;
}

StatePropagator some_propagator() { return {MotionModel::imu, some_config(), ImuNoise{}}; }

NavState some_state() {
  NavState s;
  s.T_map_body = {so3::exp({0.3, -0.2, 1.1}), {1, 2, 3}};
  return s;
}

/// Contour samples around the body, several of each segment, and the direction in which their segment stands
/// off.
std::vector<ContourOffset> some_contours(int segments) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-1, 1);
  std::vector<ContourOffset> contours;
  for (int segment = 0; segment < segments; ++segment) {
    const Eigen::Vector3d middle(2 * place(random), 2 * place(random), 3 + place(random));
    const Eigen::Vector3d across = Eigen::Vector3d(place(random), place(random), 0).normalized();
    for (int k = 0; k < 4; ++k)
      contours.push_back({middle + 0.05 * k * Eigen::Vector3d(-across.y(), across.x(), 0), kPxPerM * across,
                          0, kWeight_px2, static_cast<std::uint32_t>(10 * segment)});
  }
  return contours;
}

Vector6d by_pose(const ContourOffset& contour, const Pose& at) {
  Vector6d J;
  J << at.rotation() * contour.across_body, contour.point_body.cross(contour.across_body);
  return J;
}

/// What the present offset of the contour's segment makes up of its distance in the image.
double known_px(const BackEnd& filter, const ContourOffset& contour) {
  const Eigen::Vector3d across_map = filter.state().nav.T_map_body.rotation() * contour.across_body;
  return across_map.dot(filter.displacement_of(contour.segment));
}

/// The sum over the contours, as a registration makes it.
PoseInformation summed(const std::vector<ContourOffset>& contours, const Pose& at) {
  PoseInformation sum;
  for (const ContourOffset& contour : contours) {
    const Vector6d J = by_pose(contour, at);
    sum.information += contour.weight * J * J.transpose();
    sum.vector += contour.weight * contour.offset_px * J;
  }
  return sum;
}

/// The contours, and what a registration at the filter's pose makes of them.
void measure(BackEnd& filter, const std::vector<ContourOffset>& contours) {
  filter.update(summed(contours, filter.state().nav.T_map_body), contours);
}

TEST(SegmentOffsets, RepeatedMeasurementsGiveTheBatchSolutionOverPoseAndOffsets) {
  constexpr int kSegments = 9, kUpdates = 5;
  Ekf filter(some_propagator(), some_config());
  filter.start(0, some_state(), {0, 0, 0});
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const Pose first = some_state().T_map_body;

  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(6 + kSegments, 6 + kSegments);
  information.diagonal() << Eigen::Vector3d::Constant(1 / (kStartSigma_m * kStartSigma_m)),
      Eigen::Vector3d::Constant(1 / (kStartSigma_rad * kStartSigma_rad)),
      Eigen::VectorXd::Constant(kSegments, 1 / (kOffsetSigma_m * kOffsetSigma_m));
  Eigen::VectorXd vector = Eigen::VectorXd::Zero(6 + kSegments);
  for (int update = 0; update < kUpdates; ++update) {
    auto contours = some_contours(kSegments);
    for (ContourOffset& contour : contours) {
      // What the contours ask for, from the first pose, is small, so that the turned axes do not matter.
      const double asked = 0.002 * normal(random);
      Eigen::VectorXd row = Eigen::VectorXd::Zero(6 + kSegments);
      row.head<6>() = by_pose(contour, first);
      row(6 + contour.segment / 10) = -contour.across_body.norm();
      information += contour.weight * row * row.transpose();
      vector += contour.weight * asked * row;
      // The filter is told from where it stands, and its segments are known to stand.
      contour.offset_px =
          asked - row.head<6>().dot(filter.state().nav.T_map_body.minus(first)) + known_px(filter, contour);
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
  ASSERT_EQ(filter.segments().size(), kSegments);
  for (int i = 0; i < kSegments; ++i) {
    const SegmentOffsets::Segment& segment = filter.segments()[static_cast<std::size_t>(i)];
    const double sigma_m = std::sqrt(filter.filter().covariance(segment.block)(0, 0));
    EXPECT_NEAR(segment.offset_m, expected(6 + i), 2e-3 * sigma_m) << i;
    EXPECT_NEAR(sigma_m, std::sqrt(covariance(6 + i, 6 + i)), 2e-3 * sigma_m) << i;
  }
}

TEST(SegmentOffsets, AMapThatIsOffTellsNoMoreThanItsSegmentsAllow) {
  constexpr int kSegments = 12, kRuns = 300, kUpdates = 40;
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  double own = 0, plain = 0;
  const StatePropagator propagator = some_propagator();
  for (int run = 0; run < kRuns; ++run) {
    Ekf with(propagator, some_config());
    Ekf without(propagator);
    NavState start = some_state();
    Vector6d off;
    for (int i = 0; i < 6; ++i) off(i) = normal(random) * (i < 3 ? kStartSigma_m : kStartSigma_rad);
    start.T_map_body = start.T_map_body.plus(off);
    with.start(0, start, {0, 0, 0});
    without.start(0, start, {0, 0, 0});
    std::vector<double> offsets(kSegments);
    for (double& offset : offsets) offset = kOffsetSigma_m * normal(random);
    for (int update = 0; update < kUpdates; ++update)
      for (BackEnd* filter : {static_cast<BackEnd*>(&with), static_cast<BackEnd*>(&without)}) {
        auto contours = some_contours(kSegments);
        const Vector6d wrong = some_state().T_map_body.minus(filter->state().nav.T_map_body);
        for (ContourOffset& contour : contours)
          contour.offset_px = by_pose(contour, filter->state().nav.T_map_body).dot(wrong) -
                              contour.across_body.norm() * offsets[contour.segment / 10] +
                              known_px(*filter, contour) + normal(random) / std::sqrt(contour.weight);
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
  EXPECT_GT(plain, 20) << "or the segments' offsets are too small to matter here";
}

TEST(SegmentOffsets, TheSegmentNotSeenForLongestGivesWay) {
  Ekf filter(some_propagator(), some_config(2));
  filter.start(0, some_state(), {0, 0, 0});
  const auto contours = some_contours(3);
  const auto numbers = [&] {
    std::vector<std::uint32_t> all;
    for (const auto& segment : filter.segments()) all.push_back(segment.number);
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

TEST(SegmentOffsets, ASegmentWithoutAStateSaysNothing) {
  Ekf one(some_propagator(), some_config(1)), both(some_propagator(), some_config(1));
  const auto contours = some_contours(2);
  const std::vector<ContourOffset> first(contours.begin(), contours.begin() + 4);
  for (Ekf* filter : {&one, &both}) {
    filter->start(0, some_state(), {0, 0, 0});
    measure(*filter, filter == &one ? first : contours);
  }
  const Matrix15d& P = one.state().covariance;
  EXPECT_LT((both.state().covariance - P).norm(), 1e-9 * P.norm());
  EXPECT_LT(one.state().nav.T_map_body.minus(both.state().nav.T_map_body).norm(), 1e-12);
}

// Of a contour's own error and the model's; in pixels where the map states none.
TEST(SegmentOffsets, BeginWithWhatTheMapStatesOrWithAPartOfAPixel) {
  ErrorStateFilter filter = Ekf(some_propagator(), some_config()).filter();
  SegmentOffsetConfig config;
  SegmentOffsets offsets(config);
  ContourOffset contour = some_contours(1)[0];
  const auto sigma_m = [&] {
    const auto row = offsets.row_of(contour, filter);
    return std::sqrt(filter.covariance(row->block)(0, 0));
  };
  EXPECT_NEAR(sigma_m(), config.sigma_px / kPxPerM, 1e-12);
  contour.segment = 7;
  contour.across_body *= 0.5;  // twice as far away
  EXPECT_NEAR(sigma_m(), 2 * config.sigma_px / kPxPerM, 1e-12);
  contour.segment = 8;
  contour.sigma_m = 8e-3;
  EXPECT_NEAR(sigma_m(), std::hypot(config.sigma_m, 8e-3), 1e-12);
}

TEST(SegmentOffsets, AreStatesWhereTheMapStatesErrorsBesideAnyCalibration) {
  FusionConfig config;
  EXPECT_EQ(resolved(config, true)->segment_offsets, SegmentOffsetUse::on);
  EXPECT_EQ(resolved(config, false)->segment_offsets, SegmentOffsetUse::off);
  config.calibration.rotation = true;
  EXPECT_EQ(resolved(config, true)->segment_offsets, SegmentOffsetUse::on);
  config.segment_offsets = SegmentOffsetUse::on;
  EXPECT_EQ(resolved(config, false)->segment_offsets, SegmentOffsetUse::on);
}

}  // namespace
}  // namespace evpose
