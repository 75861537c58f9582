// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/temporal_field_polarity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "evpose/registration/temporal_field_registration.h"

namespace evpose {
namespace {

constexpr std::uint32_t kNow = 1'000'000;
constexpr double kSpan_s = 0.004;
constexpr double kFocal = 300, kDepth_m = 2;
constexpr double kEdge_px = 160, kOn_px = 158, kOff_px = 162;  // columns of the contour and of its events
constexpr double kSlant = 0.1;  // columns by row: lines lie between pixels in all ways

/// An upright contour in the middle of the image; its normal points to the right.
ContourSample upright(double speed_px_s, double flow_px_s) {
  ContourSample s;
  s.pixel = {kEdge_px, 120};
  s.normal_px = {1, 0};
  s.speed_px_s = speed_px_s;
  s.flow_px_s = flow_px_s;
  s.jacobian.setZero();
  return s;
}

/// Darker (+1) or brighter (-1) where the normal points, by the map's word.
ContrastMemory memory(int darker_side) {
  ContrastMemory out(1, 0.25);
  out.seed(0, darker_side);
  return out;
}

TEST(PredictedPolarity, IsOnWhereFlowAndGradientPointAgainstEachOther) {
  const PolarityConfig config;
  for (int darker : {-1, 1})
    for (int direction : {-1, 1})
      for (int side : {-1, 1}) {
        ContourSample s = upright(direction * 100, 120);
        s.normal_side = side;
        // The bright side comes: brightness grows. It is behind, where it is darker in front.
        const bool on = darker * side * direction > 0;
        EXPECT_EQ(predicted_polarity(s, memory(darker), config), on ? FieldPolarity::on : FieldPolarity::off);
      }
}

TEST(PredictedPolarity, NeedsAKnownContrast) {
  const ContourSample s = upright(100, 100);
  EXPECT_EQ(predicted_polarity(s, ContrastMemory(1, 0.25), {}), FieldPolarity::both);
  EXPECT_EQ(predicted_polarity(s, memory(1), {false, 3}), FieldPolarity::both);
}

TEST(BufferZone, IsAnAngleThatGrowsWithTheUncertaintyOfTheFlow) {
  // At 60 deg between gradient and flow, half of the flow is normal flow.
  ContourSample s = upright(50, 100);
  EXPECT_NEAR(test_angle(s, -1, 3).cos_theta, -0.5, 1e-12);
  EXPECT_NEAR(test_angle(s, 1, 3).cos_theta, 0.5, 1e-12);
  EXPECT_EQ(predicted_polarity(s, memory(1), {}), FieldPolarity::on);
  s.speed_sigma_px_s = 16;  // 48 px/s are three sigma
  EXPECT_NEAR(test_angle(s, -1, 3).buffer, 0.48, 1e-12);
  EXPECT_EQ(predicted_polarity(s, memory(1), {}), FieldPolarity::on);
  s.speed_sigma_px_s = 17;
  EXPECT_EQ(predicted_polarity(s, memory(1), {}), FieldPolarity::both);
  EXPECT_EQ(predicted_polarity(s, memory(1), {true, 0}), FieldPolarity::on);
  // A contour that moves along itself, or not at all.
  EXPECT_EQ(predicted_polarity(upright(0, 100), memory(1), {true, 0}), FieldPolarity::both);
  EXPECT_EQ(predicted_polarity(upright(0, 0), memory(1), {true, 0}), FieldPolarity::both);
}

TEST(SampleEvents, CountsPixelsWithANewEventWhereTheContourWas) {
  TimeSurface surface(320, 240);
  const ContourSample s = upright(1000, 1000);  // 4 px in the span: columns 156 to 160
  for (int y = 100; y < 140; ++y) {
    surface.insert(158, y, Polarity::on, kNow - 1000);
    surface.insert(157, y, Polarity::off, kNow - 3000);
    surface.insert(159, y, Polarity::off, kNow - 5000);  // before the last update
    surface.insert(170, y, Polarity::off, kNow - 1000);  // elsewhere
  }
  const SampleEvents near = events_at(surface, s, kNow, kSpan_s);
  EXPECT_EQ(near.on, 5);
  EXPECT_EQ(near.off, 5);
  EXPECT_NEAR(near.swept_px2, 20, 1e-9);
}

/// An edge whose on events lie on one line and whose off events on another, to either side of it; every
/// direction but that across the edge is held by the prior.
class TwoLines : public ::testing::Test {
 protected:
  TwoLines() {
    camera_ = std::move(make_camera({kFocal, kFocal, kEdge_px, 120, "none", {}, {320, 240}})).value();
    for (int y = 20; y < 220; y += 4) {
      ContourPoint point;
      point.position = Eigen::Vector3d(kSlant * (y - 120), y - 120, kFocal).cast<float>() * kDepth_m / kFocal;
      point.tangent = Eigen::Vector3f::UnitY();
      point.normal = Eigen::Vector3f::UnitX();
      map_.points.push_back(point);
    }
    segments_ = {std::vector<std::uint32_t>(map_.points.size(), 0), 1};
    for (int ring = 4; ring >= 0; --ring)
      for (int y = 0; y < 240; ++y)
        for (int side : {-1, 1}) {
          const std::uint32_t stamp = kNow - static_cast<std::uint32_t>(1500 * ring);
          const int column = static_cast<int>(std::lround(kSlant * (y - 120))) + side * ring;
          surface_.insert(column + static_cast<int>(kOn_px), y, Polarity::on, stamp);
          surface_.insert(column + static_cast<int>(kOff_px), y, Polarity::off, stamp);
        }
  }

  RegistrationResult measure(TemporalFieldRegistration& registration, double at_px, double speed_sigma_px_s) {
    std::vector<ContourSample> samples(map_.points.size(), upright(100, 100));
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double y = 20.0 + 4.0 * static_cast<double>(i);
      samples[i].pixel = {at_px + kSlant * (y - 120), y};
      samples[i].point = static_cast<std::uint32_t>(i);
      samples[i].speed_sigma_px_s = speed_sigma_px_s;
    }
    Matrix6d covariance = 1e-14 * Matrix6d::Identity();
    covariance(0, 0) = 1;
    const ContourView view{map_, segments_, *camera_, T_body_cam_, 0};
    RegistrationProblem problem{{}, kNow, kSpan_s, samples, covariance, &surface_, &view};
    problem.T_map_body.p.x() = (kEdge_px - at_px) * kDepth_m / kFocal;
    return registration.measure(problem);
  }
  /// Column at which the measurement puts the contour, from a prediction at column `at_px`.
  double column(const RegistrationResult& r, double at_px) const {
    return at_px - r.vector(0) / r.information(0, 0) * kFocal / kDepth_m;
  }

  static std::unique_ptr<TemporalFieldRegistration> registration(int darker_side, bool learn = false) {
    TemporalFieldConfig config;
    config.eta_s = 5e-3;
    config.learn_contrast = learn;
    config.max_iterations = 40;
    config.correlated_points = 1;
    config.converged_px = 1e-4;
    auto out = std::make_unique<TemporalFieldRegistration>(config, PolarityConfig{}, 1, 1);
    out->seed_contrast(0, -darker_side);
    return out;
  }

  std::shared_ptr<const Camera> camera_;
  Pose T_body_cam_;
  ContourMap map_;
  ContourSegments segments_;
  TimeSurface surface_{320, 240};
};

TEST_F(TwoLines, PredictedPolarityPicksTheLineOfItsEvents) {
  for (double at : {159.0, 160.0, 161.0}) {
    const auto on = registration(1), off = registration(-1);
    const RegistrationResult of_on = measure(*on, at, 0), of_off = measure(*off, at, 0);
    EXPECT_NEAR(column(of_on, at), kOn_px, 0.2) << at;
    EXPECT_NEAR(column(of_off, at), kOff_px, 0.2) << at;
    EXPECT_GT(of_on.wrong_polarity, 0);
  }
}

TEST_F(TwoLines, InTheBufferZoneBothPolaritiesCount) {
  for (int darker : {-1, 1}) {
    const auto any = registration(darker);
    const double unsure_px_s = 40;  // less than three sigma of 100 px/s
    EXPECT_NEAR(column(measure(*any, 159, unsure_px_s), 159), kOn_px, 0.2);
    const RegistrationResult nearer_off = measure(*any, 161, unsure_px_s);
    EXPECT_NEAR(column(nearer_off, 161), kOff_px, 0.2);
    EXPECT_EQ(nearer_off.wrong_polarity, 0);
    EXPECT_GT(nearer_off.events, 0);
  }
}

TEST_F(TwoLines, TheSignIsLearntFromEventsIfAsked) {
  // The contour is where on events come, again and again: it moves to the right, so it is dark there.
  for (bool learn : {true, false}) {
    const auto any = registration(0, learn);
    for (int k = 0; k < 30; ++k) measure(*any, kOn_px - 2, 0);
    EXPECT_EQ(any->contrast()->map_contrast(0), learn ? -1 : 0);
    EXPECT_EQ(measure(*any, kEdge_px, 0).wrong_polarity > 0, learn);
  }
}

TEST_F(TwoLines, WhatEventsToldOutweighsTheMap) {
  const auto any = registration(-1, true);
  for (int k = 0; k < 30; ++k) measure(*any, kOn_px - 2, 0);
  EXPECT_EQ(any->contrast()->map_contrast(0), -1);
}

}  // namespace
}  // namespace evpose
