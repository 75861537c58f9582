// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/learning_map.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>

namespace evpose::map_learn {
namespace {

/// Two rims of a floor, 10 cm long and a metre apart, each inside one cube of the segments.
ContourMap two_rims() {
  ContourMap map;
  map.planes = {{Eigen::Vector3f::UnitZ(), 0, 1000, 0.01F}};
  for (int contour = 0; contour < 2; ++contour)
    for (int i = 0; i < 10; ++i) {
      ContourPoint p;
      p.position = {0.01F + 0.01F * static_cast<float>(i), static_cast<float>(contour) + 0.05F, 0.05F};
      p.tangent = Eigen::Vector3f::UnitX();
      p.normal = Eigen::Vector3f::UnitY();
      p.length = 0.01F;
      p.sigma = 3e-3F;
      p.contour = contour;
      p.plane_a = 0;
      p.kind = ContourKind::boundary;
      map.points.push_back(p);
    }
  return map;
}

std::vector<ContourPoint> marking(float y) {
  std::vector<ContourPoint> out;
  for (ContourPoint p : two_rims().points) {
    if (p.contour != 0) continue;
    p.contour = 7;
    p.kind = ContourKind::marking;
    p.position.y() = y;
    out.push_back(p);
  }
  return out;
}

AdjustmentResult nothing_told(std::uint32_t segments) {
  AdjustmentResult out;
  out.landmarks.resize(segments);
  return out;
}

LandmarkEstimate good(double move_m) {
  LandmarkEstimate e;
  e.move_m = {move_m, 0};
  e.covariance = 0.25e-6 * Eigen::Matrix2d::Identity();
  e.chi2 = 1;
  e.observations = 20;
  return e;
}

/// `contrast`: of all points, as the events told.
FlightObservations seen(const LearningMap& map, std::int8_t contrast) {
  FlightObservations out;
  out.silent.assign(cut_into_segments(map.map()).count, false);
  out.map = map.map();
  for (ContourPoint& p : out.map.points) p.contrast = contrast;
  return out;
}

TEST(LearningMap, WhatEventsTellMovesAndTheRestStays) {
  LearningMap map(two_rims());
  const ContourSegments segments = cut_into_segments(map.map());
  ASSERT_EQ(segments.count, 2u);
  AdjustmentResult result = nothing_told(2);
  result.landmarks[segments.of_point[0]] = good(4e-3);
  map.apply(result, segments, seen(map, 1));
  const ContourMap given = two_rims();
  for (std::size_t i = 0; i < 20; ++i) {
    const Eigen::Vector3f moved = map.map().points[i].position - given.points[i].position;
    EXPECT_NEAR((moved - (i < 10 ? 4e-3F : 0.0F) * Eigen::Vector3f::UnitY()).norm(), 0, 1e-6);
    EXPECT_EQ(map.map().points[i].contrast, i < 10 ? 1 : 0);
    EXPECT_NEAR(map.map().points[i].sigma, i < 10 ? std::sqrt(0.5e-6F / 16 + 0.09e-6F) : 3e-3F, 1e-6F);
  }
  EXPECT_NEAR(map.lengths().moved_m, 0.1, 1e-6);
  EXPECT_NEAR(map.lengths().kept_m, 0.1, 1e-6);
}

TEST(LearningMap, AnAppliedMoveIsHeldAgainstWhereTheContourWasGiven) {
  LearningMap map(two_rims());
  const ContourSegments segments = cut_into_segments(map.map());
  AdjustmentResult result = nothing_told(2);
  result.landmarks[segments.of_point[0]] = good(4e-3);
  map.apply(result, segments, seen(map, 1));
  const auto landmarks = map.landmarks(segments);
  EXPECT_NEAR(landmarks[segments.of_point[0]].moved_m(0), 4e-3, 1e-6);
  EXPECT_NEAR(landmarks[segments.of_point[0]].sigma_m(0), std::hypot(3e-3, 6e-3), 1e-6);
  EXPECT_NEAR(landmarks[segments.of_point[10]].moved_m.norm(), 0, 1e-6);
}

TEST(LearningMap, ALongContourTellsAsMuchAsTheMeanOfItsCorrelatedSegments) {
  ContourMap given = two_rims();
  for (int i = 10; i < 120; ++i) {
    ContourPoint p = given.points[0];
    p.position.x() += 0.01F * static_cast<float>(i);
    given.points.push_back(p);
  }
  const LearningMap map(given);
  const ContourSegments segments = cut_into_segments(map.map());
  const int n = static_cast<int>(segments.count) - 1;
  ASSERT_GT(n, 7);
  const auto landmarks = map.landmarks(segments);
  const std::uint32_t short_one = segments.of_point[10];
  double information = 0;
  for (std::uint32_t s = 0; s < segments.count; ++s)
    if (s != short_one) information += 1 / (landmarks[s].sigma_m(0) * landmarks[s].sigma_m(0));
  constexpr double kCorrelation = 0.3;
  const Eigen::MatrixXd covariance =
      std::pow(landmarks[short_one].sigma_m(0), 2) *
      (kCorrelation * Eigen::MatrixXd::Ones(n, n) + (1 - kCorrelation) * Eigen::MatrixXd::Identity(n, n));
  EXPECT_NEAR(information / covariance.inverse().sum(), 1, 1e-9);
}

TEST(LearningMap, AContourThatWasDisplacedBeforehandGoesBackIfNothingIsSeenOfIt) {
  LearningMap map(two_rims());
  const std::vector<ContourPoint> given = map.map().points;
  map.displace(std::vector<Eigen::Vector3d>(given.size(), Eigen::Vector3d(0, 0, 5e-3)));
  const ContourSegments segments = cut_into_segments(map.map());
  EXPECT_NEAR(map.landmarks(segments)[segments.of_point[0]].moved_m.norm(), 5e-3, 1e-6);
  AdjustmentResult result = nothing_told(2);
  result.landmarks[segments.of_point[0]] = good(0);
  map.apply(result, segments, seen(map, 1));
  EXPECT_NEAR((map.map().points[0].position - given[0].position).norm(), 5e-3, 1e-6);
  EXPECT_EQ(map.map().points[10].position, given[10].position);
}

TEST(LearningMap, AContourThatItsEventsContradictIsStruckOut) {
  LearningMap map(two_rims());
  const ContourSegments segments = cut_into_segments(map.map());
  AdjustmentResult result = nothing_told(2);
  result.landmarks[segments.of_point[0]] = good(0);
  result.landmarks[segments.of_point[0]].chi2 = 6;
  map.apply(result, segments, seen(map, 1));
  ASSERT_EQ(map.map().points.size(), 10u);
  EXPECT_EQ(map.map().points[0].contour, 1);
  EXPECT_NEAR(map.lengths().struck_m, 0.1, 1e-6);
}

TEST(LearningMap, OnlyAContourThatHadEventsBeforeIsGoneWithoutThem) {
  ContourMap given = two_rims();
  for (std::size_t i = 0; i < 10; ++i) given.points[i].contrast = 1;
  LearningMap map(given);
  const ContourSegments segments = cut_into_segments(map.map());
  FlightObservations observed = seen(map, 0);
  observed.silent.assign(2, true);
  map.apply(nothing_told(2), segments, observed);
  ASSERT_EQ(map.map().points.size(), 10u);
  EXPECT_EQ(map.map().points[0].contour, 1);
  EXPECT_NEAR(map.lengths().gone_m, 0.1, 1e-6);
  EXPECT_NEAR(map.lengths().silent_m, 0.1, 1e-6);
  EXPECT_NEAR(map.lengths().struck_m, 0, 1e-6);
}

TEST(LearningMap, AMarkingStaysIfEventsTellItsPlaceAndContrast) {
  for (const std::int8_t contrast : {std::int8_t{0}, std::int8_t{1}}) {
    LearningMap map(two_rims());
    map.add_new(marking(0.53F));
    const ContourSegments segments = cut_into_segments(map.map());
    AdjustmentResult result = nothing_told(segments.count);
    result.landmarks[segments.of_point[25]] = good(1e-3);
    map.apply(result, segments, seen(map, contrast));
    EXPECT_EQ(map.map().points.size(), contrast != 0 ? 30u : 20u);
    EXPECT_NEAR(map.lengths().new_m, contrast != 0 ? 0.1 : 0, 1e-6);
  }
}

TEST(LearningMap, ANewMarkingIsFreeAlongItsPlaneAndOneOfAnEarlierFlightIsHeldByItsSigma) {
  LearningMap first(two_rims());
  first.add_new(marking(0.53F));
  ContourSegments segments = cut_into_segments(first.map());
  EXPECT_GT(first.landmarks(segments)[segments.of_point[25]].sigma_m(0), 0.02);
  AdjustmentResult result = nothing_told(segments.count);
  result.landmarks[segments.of_point[25]] = good(0);
  first.apply(result, segments, seen(first, 1));
  const LearningMap second(first.map());
  segments = cut_into_segments(second.map());
  const Landmark held = second.landmarks(segments)[segments.of_point[25]];
  EXPECT_NEAR(held.sigma_m(0), static_cast<double>(second.map().points[25].sigma), 1e-9);
}

/// Of a landmark seen `looks` times from one direction.
void add_looks(FlightObservations& observed, std::uint32_t landmark, int looks, const Eigen::Vector3d& from) {
  for (int i = 0; i < looks; ++i) {
    Observation o;
    o.landmark = landmark;
    observed.observations.push_back(o);
    observed.views.push_back(from.normalized());
  }
}

/// Flown over once: the first rim was told, from above; the frame stands within 2 mm.
ContourMap told_once() {
  LearningMap map(two_rims());
  const ContourSegments segments = cut_into_segments(map.map());
  AdjustmentResult result = nothing_told(2);
  result.landmarks[segments.of_point[0]] = good(1e-3);
  FlightObservations observed = seen(map, 1);
  add_looks(observed, segments.of_point[0], 20, {0, 0, 1});
  map.apply(result, segments, observed);
  map.set_frame({0, 0, 1}, 4e-6 * Matrix6d::Identity());
  return map.map();
}

TEST(LearningMap, HowOftenAndFromWhereAContourWasSeenAddsUp) {
  const ContourMap once = told_once();
  EXPECT_EQ(once.points[0].looks, 20);
  EXPECT_NEAR(once.points[0].seen_from.z(), 1, 1e-6);
  EXPECT_EQ(once.points[10].looks, 0);
  LearningMap second(once);
  const ContourSegments segments = cut_into_segments(second.map());
  AdjustmentResult result = nothing_told(2);
  result.shared = Eigen::VectorXd::Zero(6);
  for (const std::uint32_t s : {segments.of_point[0], segments.of_point[10]}) result.landmarks[s] = good(0);
  FlightObservations observed = seen(second, 1);
  for (const std::uint32_t s : {segments.of_point[0], segments.of_point[10]})
    add_looks(observed, s, 20, {0, 1, 0});
  // Passes of one flight count once.
  for (int pass = 0; pass < 2; ++pass) second.apply(result, segments, observed);
  EXPECT_EQ(second.map().points[0].looks, 40);
  EXPECT_LT((second.map().points[0].seen_from - Eigen::Vector3f(0, 0.5F, 0.5F)).norm(), 1e-6F);
  EXPECT_EQ(second.map().points[10].looks, 20);
}

TEST(LearningMap, WhatWasToldBeforeSharesTheErrorOfItsFrame) {
  LearningMap second(told_once());
  const ContourSegments segments = cut_into_segments(second.map());
  const std::vector<Landmark> landmarks = second.landmarks(segments);
  const Landmark &told = landmarks[segments.of_point[0]], &untold = landmarks[segments.of_point[10]];
  EXPECT_TRUE(untold.shared.empty());
  ASSERT_EQ(told.shared.size(), 6u);
  EXPECT_EQ(second.shared_covariance(), Eigen::MatrixXd(4e-6 * Matrix6d::Identity()));
  EXPECT_LT(told.sigma_m(0), 0.5e-3) << "its own; the frame's 2 mm are beside it";
  // Turned about x by 1 mrad and displaced upwards by 3 mm: it moves though this flight does not see it.
  AdjustmentResult result = nothing_told(2);
  result.shared = Eigen::VectorXd::Zero(6);
  result.shared(2) = 3e-3;
  result.shared(3) = 1e-3;
  const Eigen::Vector3f before = second.map().points[0].position;
  second.apply(result, segments, seen(second, 1));
  const Eigen::Vector3f moved = second.map().points[0].position - before;
  const Eigen::Vector3f expected(0, 1e-3F * (1 - before.z()), 3e-3F + 1e-3F * before.y());
  EXPECT_LT((moved - expected).norm(), 1e-7F);
  EXPECT_EQ(second.map().points[10].position, told_once().points[10].position);
}

}  // namespace
}  // namespace evpose::map_learn
