// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>
#include <random>

#include "evpose/eval/map_score.h"
#include "evpose/eval/measures.h"
#include "evpose/eval/score.h"
#include "evpose/map/point_cloud.h"

namespace evpose {
namespace {

constexpr double kDeg = std::numbers::pi / 180;

/// A lively flight: pose of the body at t.
Pose flight(double t_s) {
  Pose T;
  T.p = Eigen::Vector3d(1.5 * std::sin(1.1 * t_s), 1.2 * std::cos(0.9 * t_s),
                        1 + 0.4 * std::sin(0.7 * t_s + 1));
  T.q = so3::exp(Eigen::Vector3d(0.3 * std::sin(1.3 * t_s), 0.2 * std::cos(1.7 * t_s), 0.5 * t_s));
  return T;
}

std::vector<TimedPose> flight_at(double rate_hz, double from_s, double to_s, double delay_s = 0) {
  std::vector<TimedPose> out;
  const TimeNs step = from_seconds(1 / rate_hz);
  for (TimeNs t = from_seconds(from_s); t <= from_seconds(to_s); t += step)
    out.push_back({t, flight(to_seconds(t) - delay_s)});
  return out;
}

std::vector<TimedPose> with_noise(std::vector<TimedPose> poses, double sigma_m, double sigma_rad,
                                  unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (TimedPose& p : poses) {
    Vector6d d;
    for (int i = 0; i < 6; ++i) d[i] = normal(random) * (i < 3 ? sigma_m : sigma_rad);
    p.pose = p.pose.plus(d);
  }
  return poses;
}

TrajectoryScore score(const std::vector<TimedPose>& estimate, const std::vector<TimedPose>& truth,
                      Alignment alignment = Alignment::none) {
  ScoreOptions options;
  options.alignment = alignment;
  return score_trajectory({estimate, truth, {}, {}, {}}, options);
}

TEST(Statistics, OfOneToFour) {
  const Statistics s = summarise({4, 1, 3, 2});
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(7.5));
  EXPECT_NEAR(s.p95, 3.85, 1e-12);
  EXPECT_DOUBLE_EQ(s.max, 4);
  EXPECT_EQ(summarise({}).max, 0);
}

TEST(Score, OfTheTruthItselfIsZero) {
  const auto truth = flight_at(200, 0, 4);
  const TrajectoryScore s = score(truth, truth);
  EXPECT_EQ(s.pairs, truth.size());
  EXPECT_EQ(s.coverage, 1);
  EXPECT_TRUE(s.lost.empty());
  EXPECT_EQ(s.ate_mm.max, 0);
  EXPECT_LT(s.are_deg.max, 1e-6);
  EXPECT_EQ(*s.lag_ms, 0);
  EXPECT_LT(s.over_1s->translation_mm, 1e-9);
}

TEST(Score, ConstantOffsetIsItsLength) {
  const auto truth = flight_at(200, 0, 4);
  auto estimate = truth;
  for (TimedPose& p : estimate) {
    p.pose.p += Eigen::Vector3d(0.003, 0, 0.004);
    p.pose.q = p.pose.q * so3::exp(Eigen::Vector3d(0, 2 * kDeg, 0));
  }
  const TrajectoryScore s = score(estimate, truth);
  EXPECT_NEAR(s.ate_mm.mean, 5, 1e-9);
  EXPECT_NEAR(s.ate_mm.max, 5, 1e-9);
  EXPECT_NEAR(s.are_deg.median, 2, 1e-9);
  EXPECT_NEAR(s.over_100ms->rotation_deg, 0, 0.2);
  EXPECT_NEAR(*s.jitter_mm, 0, 1e-9);
}

TEST(Score, AlignedErrorIsInvariantUnderRigidTransforms) {
  const auto truth = flight_at(200, 0, 6);
  const auto estimate = with_noise(flight_at(90, 0.5, 5.5), 0.02, 0.01, 1);
  const Pose T{so3::exp(Eigen::Vector3d(1, -2, 0.5)), Eigen::Vector3d(10, -20, 3)};
  auto moved = estimate;
  for (TimedPose& p : moved) p.pose = T * p.pose;
  const TrajectoryScore a = score(estimate, truth, Alignment::se3), b = score(moved, truth, Alignment::se3);
  EXPECT_NEAR(a.ate_mm.rmse, b.ate_mm.rmse, 1e-8);
  EXPECT_NEAR(a.are_deg.mean, b.are_deg.mean, 1e-8);
  EXPECT_NEAR(a.over_1s->translation_mm, b.over_1s->translation_mm, 1e-8);
  EXPECT_NEAR(*a.lag_ms, *b.lag_ms, 1e-8);
  EXPECT_LT(a.ate_mm.rmse, score(estimate, truth).ate_mm.rmse);
}

TEST(Score, YawAlignmentTakesOutYawAndTranslationOnly) {
  const auto truth = flight_at(200, 0, 6);
  auto turned = truth, tilted = truth;
  const Pose yaw{so3::exp(Eigen::Vector3d(0, 0, 1.2)), Eigen::Vector3d(1, 2, 3)};
  const Pose tilt{so3::exp(Eigen::Vector3d(0.1, 0, 0)), Eigen::Vector3d::Zero()};
  for (TimedPose& p : turned) p.pose = yaw * p.pose;
  for (TimedPose& p : tilted) p.pose = tilt * p.pose;
  EXPECT_LT(score(turned, truth, Alignment::yaw).ate_mm.max, 1e-9);
  EXPECT_GT(score(tilted, truth, Alignment::yaw).ate_mm.rmse, 10);
  EXPECT_LT(score(tilted, truth, Alignment::se3).ate_mm.max, 1e-9);
}

TEST(Score, Sim3FindsTheScale) {
  const auto truth = flight_at(200, 0, 6);
  auto small = truth;
  for (TimedPose& p : small) p.pose.p *= 0.5;
  const TrajectoryScore s = score(small, truth, Alignment::sim3);
  EXPECT_NEAR(s.T_truth_estimate.scale, 2, 1e-9);
  EXPECT_LT(s.ate_mm.max, 1e-9);
  EXPECT_GT(score(small, truth, Alignment::se3).ate_mm.rmse, 100);
}

TEST(Score, AlignmentOverTheFirstSecondsLeavesLaterDrift) {
  const auto truth = flight_at(200, 0, 6);
  auto estimate = truth;
  for (TimedPose& p : estimate)
    if (p.t > 3 * kNsPerS) p.pose.p.x() += 0.1;
  ScoreOptions options;
  options.alignment = Alignment::se3;
  options.align_first_s = 2;
  const TrajectoryScore s = score_trajectory({estimate, truth, {}, {}, {}}, options);
  EXPECT_NEAR(s.ate_mm.max, 100, 1e-6);
  EXPECT_NEAR(s.ate_mm.median, 0, 1e-6);
}

TEST(Score, LagOfATrajectoryLateByFiveMsIsFiveMs) {
  const TrajectoryScore s = score(flight_at(300, 0.1, 7.9, 0.005), flight_at(1000, 0, 8));
  EXPECT_NEAR(*s.lag_ms, 5, 0.01);
  EXPECT_LT(*s.lag_standard_error_ms, 0.01);
}

TEST(Score, LagStandardErrorCoversTheTruthUnderSlowErrors) {
  // Errors that persist for a tenth of a second: the estimate of the lag scatters by about its standard
  // error.
  const auto truth = flight_at(1000, 0, 8);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double sum = 0;
  constexpr int kRuns = 60;
  for (int run = 0; run < kRuns; ++run) {
    auto estimate = flight_at(200, 0.1, 7.9);
    Eigen::Vector3d error = Eigen::Vector3d::Zero();
    for (TimedPose& p : estimate) {
      error = 0.95 * error + 1e-3 * Eigen::Vector3d(normal(random), normal(random), normal(random));
      p.pose.p += error;
    }
    const TrajectoryScore s = score(estimate, truth);
    sum += std::pow(*s.lag_ms / *s.lag_standard_error_ms, 2);
  }
  EXPECT_NEAR(std::sqrt(sum / kRuns), 1, 0.35);
}

TEST(Score, NeesByDirectionShowsTheDirectionWhoseCovarianceIsTooSmall) {
  const auto truth = flight_at(1000, 0, 2);
  auto estimate = flight_at(200, 0, 2);
  const Eigen::Vector3d sigma_m(1e-3, 2e-3, 5e-3), sigma_rad(3e-3, 1e-3, 1e-3);
  std::vector<Matrix6d> covariances;
  for (TimedPose& p : estimate) {
    const Eigen::Matrix3d R = p.pose.rotation();
    Matrix6d P = Matrix6d::Zero();
    P.topLeftCorner<3, 3>() = R * sigma_m.cwiseAbs2().asDiagonal() * R.transpose();
    P.diagonal().tail<3>() = sigma_rad.cwiseAbs2();
    covariances.push_back(P);
    p.pose.p += R * Eigen::Vector3d(0.5e-3, 0, 15e-3);  // half, none and three of its sigma
    p.pose.q = p.pose.q * so3::exp(Eigen::Vector3d(0, 2e-3, 0));
  }
  const TrajectoryScore s = score_trajectory({estimate, truth, covariances, {}, {}}, {});
  const auto near = [](const Eigen::Vector3d& seen, const Eigen::Vector3d& expected) {
    EXPECT_LT((seen - expected).norm(), 1e-2 * expected.norm()) << seen.transpose();
  };
  near(s.nees_by_direction->position, {0.25, 0, 9});
  near(s.nees_by_direction->rotation, {0, 4, 0});
  EXPECT_NEAR(s.nees_by_direction->weakest_position, 9, 0.1);
  EXPECT_NEAR(s.nees_by_direction->weakest_rotation, 0, 0.1);
}

TEST(Score, NeesOfErrorsDrawnFromTheCovarianceIsOne) {
  const auto truth = flight_at(1000, 0, 8);
  auto estimate = flight_at(500, 0, 8);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::vector<Matrix6d> covariances;
  for (TimedPose& p : estimate) {
    const Matrix6d a = Matrix6d::NullaryExpr([&] { return 1e-3 * normal(random); });
    covariances.push_back(a * a.transpose() + 1e-7 * Matrix6d::Identity());
    const Vector6d d =
        covariances.back().llt().matrixL() * Vector6d::NullaryExpr([&] { return normal(random); });
    p.pose = p.pose.plus(-d);
  }
  const TrajectoryScore s = score_trajectory({estimate, truth, covariances, {}, {}}, {});
  EXPECT_NEAR(*s.nees6_mean, 1, 0.04);
  EXPECT_NEAR(*s.nees6_in_band, 0.95, 0.01);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(s.nees_by_direction->position(i), 1, 0.25);
    EXPECT_NEAR(s.nees_by_direction->rotation(i), 1, 0.25);
  }
  EXPECT_NEAR(s.nees_by_direction->weakest_position, 1, 0.25);
  EXPECT_NEAR(s.nees_by_direction->weakest_rotation, 1, 0.25);

  // Alignment turns the covariance with the estimate's frame.
  const Pose T{so3::exp(Eigen::Vector3d(0.4, 1, -2)), Eigen::Vector3d(1, 2, 3)};
  auto moved = estimate;
  auto moved_covariances = covariances;
  Matrix6d J = Matrix6d::Identity();
  J.topLeftCorner<3, 3>() = T.rotation();
  for (std::size_t i = 0; i < moved.size(); ++i) {
    moved[i].pose = T * moved[i].pose;
    moved_covariances[i] = J * covariances[i] * J.transpose();
  }
  ScoreOptions se3;
  se3.alignment = Alignment::se3;
  EXPECT_NEAR(*score_trajectory({moved, truth, moved_covariances, {}, {}}, se3).nees6_mean, 1, 0.04);
}

TEST(Score, CovariancesThatAreNotPositiveDefiniteAreLeftOut) {
  const auto truth = flight_at(200, 0, 1);
  const std::vector<Matrix6d> zero(truth.size(), Matrix6d::Zero());
  EXPECT_FALSE(score_trajectory({truth, truth, zero, {}, {}}, {}).nees6_mean);
}

TEST(Score, VelocityAndAlongMotionErrors) {
  std::vector<TimedPose> truth, estimate;
  for (int i = 0; i <= 100; ++i) {
    truth.push_back({i * 10 * kNsPerMs, {Eigen::Quaterniond::Identity(), {0.01 * i, 0, 0}}});  // 1 m/s
    estimate.push_back({i * 10 * kNsPerMs, {Eigen::Quaterniond::Identity(), {0.01 * i + 0.002, 0.05, 0}}});
  }
  const std::vector<Eigen::Vector3d> velocities(estimate.size(), Eigen::Vector3d(1, 0.03, 0.04));
  const std::vector<double> pixels_per_metre(estimate.size(), 200.0);
  const TrajectoryScore s = score_trajectory({estimate, truth, {}, velocities, pixels_per_metre}, {});
  EXPECT_NEAR(*s.velocity_rmse_mm_s, 50, 1e-9);
  EXPECT_NEAR(*s.along_motion_px, 0.4, 1e-9);
  EXPECT_NEAR(*s.lag_ms, -2, 1e-9);
}

TEST(Score, CoverageAndLostStretches) {
  const auto truth = flight_at(1000, 0, 2);
  auto estimate = flight_at(100, 0, 2);
  std::erase_if(estimate, [](const TimedPose& p) { return p.t > 505 * kNsPerMs && p.t < 995 * kNsPerMs; });
  const TrajectoryScore s = score(estimate, truth);
  // Last pose at 0.50, next at 1.00: instants 0.53 ... 0.97 are further than 20 ms from both.
  EXPECT_NEAR(s.coverage, 1 - 45.0 / 200, 1e-12);
  ASSERT_EQ(s.lost.size(), 1u);
  EXPECT_EQ(s.lost[0].from, 530 * kNsPerMs);
  EXPECT_EQ(s.lost[0].to, 980 * kNsPerMs);
}

TEST(Score, CoverageOfALongSilenceTakesNoTime) {
  auto truth = flight_at(100, 0, 1);
  truth.push_back({1'700'000'000 * kNsPerS, {}});
  const TrajectoryScore s = score(truth, truth);
  EXPECT_LT(s.coverage, 1e-6);
  EXPECT_EQ(s.pairs, 100u);  // the last two poses are the ends of a gap
}

TEST(Measures, CoverageCountsWhatReachesIntoTheSpan) {
  std::vector<ErrorSample> samples(3);
  samples[0].t = -200 * kNsPerMs;
  samples[1].t = -15 * kNsPerMs;  // reaches instant 0
  samples[2].t = 115 * kNsPerMs;  // reaches from 95 on, after the last instant
  const Coverage c = coverage_of(samples, 0, 100 * kNsPerMs);
  EXPECT_NEAR(c.share, 0.1, 1e-12);
  ASSERT_EQ(c.lost.size(), 1u);
  EXPECT_EQ(c.lost[0].from, 10 * kNsPerMs);
  EXPECT_EQ(c.lost[0].to, 100 * kNsPerMs);
  EXPECT_EQ(coverage_of(samples, 5, 5).share, 0);
}

TEST(Association, LeavesOutGapsAndRepeatedStamps) {
  auto truth = flight_at(100, 0, 2);
  std::erase_if(truth, [](const TimedPose& p) { return p.t > 995 * kNsPerMs && p.t < 1095 * kNsPerMs; });
  auto estimate = flight_at(250, 0, 2);
  estimate.insert(estimate.begin() + 10, estimate[10]);
  const auto pairs = associate(estimate, truth, {});
  EXPECT_EQ(pairs.size(), 501u - 27u);  // 0.992 ... 1.096
  for (const PosePair& p : pairs) EXPECT_TRUE(p.t <= 990 * kNsPerMs || p.t >= 1100 * kNsPerMs);
}

TEST(Association, NearestTakesTheNearerPoseUpToTheLimit) {
  const std::vector<TimedPose> truth{{0, {}}, {100 * kNsPerMs, {Eigen::Quaterniond::Identity(), {1, 0, 0}}}};
  const std::vector<TimedPose> estimate{{10 * kNsPerMs, {}}, {11 * kNsPerMs, {}}, {95 * kNsPerMs, {}}};
  AssociationOptions options;
  options.rule = AssociationRule::nearest;
  const auto pairs = associate(estimate, truth, options);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].truth.p.x(), 0);
  EXPECT_EQ(pairs[1].truth.p.x(), 1);
  EXPECT_EQ(pairs[1].index, 2u);
}

TEST(Association, InterpolatesHalfwayPoses) {
  const std::vector<TimedPose> truth{{0, {}},
                                     {20 * kNsPerMs, {so3::exp({0, 0, 1}), Eigen::Vector3d(2, 4, 6)}}};
  const std::vector<TimedPose> estimate{{10 * kNsPerMs, {}}};
  const auto pairs = associate(estimate, truth, {});
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_TRUE(pairs[0].truth.p.isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_NEAR((so3::log(pairs[0].truth.q) - Eigen::Vector3d(0, 0, 0.5)).norm(), 0, 1e-12);
  EXPECT_TRUE(pairs[0].true_velocity.isApprox(Eigen::Vector3d(100, 200, 300)));
}

TEST(Score, JudgesOnlyTheAskedSpan) {
  const auto truth = flight_at(200, 0, 4);
  auto estimate = flight_at(100, 0, 4);
  for (TimedPose& p : estimate)
    if (p.t > 2 * kNsPerS) p.pose.p.y() += 1;
  ScoreOptions options;
  options.from = kNsPerS / 2;
  options.to = 2 * kNsPerS;
  const TrajectoryScore s = score_trajectory({estimate, truth, {}, {}, {}}, options);
  EXPECT_EQ(s.pairs, 151u);
  EXPECT_LT(s.ate_mm.max, 1);
  EXPECT_EQ(s.coverage, 1);
}

TEST(Score, WithoutOverlapHasNoFigures) {
  const TrajectoryScore s = score(flight_at(100, 10, 11), flight_at(100, 0, 1));
  EXPECT_EQ(s.pairs, 0u);
  EXPECT_EQ(s.coverage, 0);
  EXPECT_TRUE(s.words().empty());
  ASSERT_EQ(s.lost.size(), 1u);
  EXPECT_EQ(s.lost[0].to, kNsPerS);
  EXPECT_TRUE(score({}, {}).words().empty());
}

TEST(Score, StillEstimatesGiveNoNan) {
  const std::vector<TimedPose> still{{0, {}}, {10 * kNsPerMs, {}}, {20 * kNsPerMs, {}}};
  for (const auto kind : {Alignment::none, Alignment::se3, Alignment::yaw, Alignment::sim3}) {
    const TrajectoryScore s = score(still, still, kind);
    EXPECT_FALSE(s.lag_ms);
    EXPECT_FALSE(s.over_1m);
    for (const auto& [name, value] : s.words()) EXPECT_TRUE(std::isfinite(value)) << name;
  }
}

TEST(Score, RelativeErrorPerMetreOfAScaleErrorIsTheScaleError) {
  std::vector<TimedPose> truth, estimate;
  for (int i = 0; i <= 300; ++i) {
    truth.push_back({i * 10 * kNsPerMs, {Eigen::Quaterniond::Identity(), {0.01 * i, 0, 0}}});
    estimate.push_back({i * 10 * kNsPerMs, {Eigen::Quaterniond::Identity(), {0.0101 * i, 0, 0}}});
  }
  const TrajectoryScore s = score(estimate, truth);
  EXPECT_NEAR(s.over_1m->translation_mm, 10, 0.2);
  EXPECT_NEAR(s.over_1s->translation_mm, 10, 0.2);  // near the end, spans down to 0.7 s count
  EXPECT_NEAR(s.over_10ms->translation_mm, 0.1, 1e-6);
}

/// A straight contour along x from `from` to `to`, moved by `off` across it.
ContourMap straight_contour(double from, double to, double off) {
  ContourMap map;
  for (double x = from + 0.005; x < to; x += 0.01) {
    ContourPoint p;
    p.position = Eigen::Vector3d(x, off, 0).cast<float>();
    p.tangent = Eigen::Vector3f::UnitX();
    p.normal = Eigen::Vector3f::UnitY();
    p.length = 0.01F;
    p.sigma = 0.002F;
    p.kind = ContourKind::crease;
    map.points.push_back(p);
  }
  return map;
}

TEST(MapScore, AShiftIsTheDistanceAndHalfTheLengthIsHalfTheRecall) {
  const ContourMap truth = straight_contour(0, 2, 0);
  const MapScore shifted = score_map(straight_contour(0, 1, 0.004), truth, nullptr, {});
  EXPECT_NEAR(shifted.all.p50_mm, 4, 1e-3);
  EXPECT_NEAR(shifted.all.p95_mm, 4, 1e-3);
  EXPECT_NEAR(shifted.all.precision_5mm, 1, 1e-9);
  EXPECT_NEAR(shifted.all.recall_5mm, 0.5, 0.02);
  // 4 mm over 2 mm, in one of the two directions across.
  EXPECT_NEAR(shifted.all.sigma_ratio, 2 / std::sqrt(2.0), 1e-3);
  const MapScore further = score_map(straight_contour(0, 2, 0.007), truth, nullptr, {});
  EXPECT_EQ(further.crease.precision_5mm, 0);
  EXPECT_NEAR(further.crease.precision_10mm, 1, 1e-9);
  EXPECT_NEAR(further.crease.recall_10mm, 1, 1e-9);
  EXPECT_EQ(further.boundary.built_m, 0);
}

TEST(MapScore, SigmaOfTheBulkIsToldApartFromWrongEdgesAndViewDependentContoursDoNotCount) {
  const ContourMap truth = straight_contour(0, 20, 0);
  ContourMap built = truth;
  std::mt19937 random(12);
  std::normal_distribution<float> off(0, 0.002F);
  for (std::size_t i = 0; i < built.points.size(); ++i) {
    Eigen::Vector3f& x = built.points[i].position;
    x.y() = off(random), x.z() = off(random);
    if (i % 10 == 0) x.y() = 0.02F;
    if (i % 10 == 1) built.points[i].kind = ContourKind::shadow, x.y() = 0.02F;
  }
  const KindScore all = score_map(built, truth, nullptr, {}).all;
  EXPECT_NEAR(all.sigma_bulk, 1.09, 0.04);  // the median of eight good ones and a bad one
  EXPECT_NEAR(all.outliers, 1.0 / 9, 0.005);
  EXPECT_GT(all.sigma_ratio, 2);
  EXPECT_NEAR(all.built_m, 18, 1e-3);
}

TEST(MapScore, RecallIsToldByTheNextParallelEdgeAndByTheDistanceFromWhatWasFlown) {
  ContourMap truth = straight_contour(0, 2, 0);
  for (const auto& p : straight_contour(0, 1, 0.2).points) truth.points.push_back(p);
  MapScoreConfig config;
  config.flown = {{-3, 0, 0}, {-9, 0, 0}};
  const MapScore score = score_map(straight_contour(0, 1, 0), truth, nullptr, config);
  // Half of the first edge and all of the second have another 20 cm beside them.
  EXPECT_NEAR(score.by_parallel_edge[4].true_m, 2, 0.05);
  EXPECT_NEAR(score.by_parallel_edge[4].recall_5mm, 0.5, 0.02);
  EXPECT_NEAR(score.by_parallel_edge[5].true_m, 1, 0.05);
  EXPECT_NEAR(score.by_parallel_edge[5].recall_5mm, 0, 0.05);
  // The first metre of both is 3 to 4 m off, the second of one 4 to 5 m.
  EXPECT_NEAR(score.by_distance_flown[1].true_m, 2, 0.05);
  EXPECT_NEAR(score.by_distance_flown[1].recall_5mm, 0.5, 0.02);
  EXPECT_NEAR(score.by_distance_flown[2].true_m, 1, 0.05);
  EXPECT_NEAR(score.by_distance_flown[2].recall_5mm, 0, 0.05);
}

TEST(MapScore, ShortAndUnseenEdgesDoNotCount) {
  ContourMap truth = straight_contour(0, 2, 0);
  for (const auto& p : straight_contour(5, 5.2, 0).points) truth.points.push_back(p);
  PointCloud cloud;
  for (double x = 0; x < 1; x += 0.004) cloud.points.emplace_back(static_cast<float>(x), 0.01F, 0.0F);
  const MapScore score = score_map(truth, truth, &cloud, {});
  EXPECT_NEAR(score.short_m, 0.2, 0.02);
  EXPECT_NEAR(score.unseen_m, 1, 0.1);
  EXPECT_NEAR(score.all.recall_5mm, 1, 1e-9);
}

}  // namespace
}  // namespace evpose
