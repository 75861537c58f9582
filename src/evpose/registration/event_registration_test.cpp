// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/event_registration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr std::uint32_t kNow = 500'000;
constexpr double kSpan_s = 0.004;
constexpr double kFocal = 300;  // px per metre of the toy camera: a shift of the body shifts the image

/// Straight contours in a 320 x 240 image; the pose's first two parameters shift the image, the others do
/// nothing.
class EventRegistrationLaws : public ::testing::Test {
 protected:
  EventRegistrationLaws() { covariance_.setZero(); }

  /// Samples each 4 px along a line through `at` across `normal`, which moves at `speed` px/s.
  void add_line(const Eigen::Vector2d& at, const Eigen::Vector2d& normal, double speed, int count = 20) {
    const Eigen::Vector2d n = normal.normalized(), t(-n.y(), n.x());
    for (int k = 0; k < count; ++k) {
      ContourSample s;
      s.pixel = at + 4.0 * k * t;
      s.normal_px = n;
      s.speed_px_s = speed;
      s.flow_px_s = std::abs(speed);
      s.jacobian.setZero();
      s.jacobian.head<2>() = -kFocal * n;  // dd/dp: the contour moves along +n, the distance shrinks
      samples_.push_back(s);
    }
  }

  /// One event a pixel along each line at a random age, `offset` px along the normal from the contour of
  /// then.
  void draw_events(double offset, unsigned seed = 1) {
    std::mt19937 random(seed);
    for (const auto& s : samples_) {
      const Eigen::Vector2d t(-s.normal_px.y(), s.normal_px.x());
      for (int j = -2; j < 2; ++j) {
        const double age = kSpan_s * static_cast<double>(random() % 1000) / 1000;
        const Eigen::Vector2d x = s.pixel + j * t + (offset - s.speed_px_s * age) * s.normal_px;
        add_event(x, age);
      }
    }
  }
  void add_event(const Eigen::Vector2d& x, double age_s) {
    FilteredEvent e{};
    e.stamp_us = kNow - static_cast<std::uint32_t>(std::lround(age_s * 1e6));
    e.x = static_cast<std::uint16_t>(std::lround(x.x()));
    e.y = static_cast<std::uint16_t>(std::lround(x.y()) & 0x7FFF);
    events_.push_back(e);
  }

  RegistrationResult measure() {
    EventRegistration registration({320, 240}, config_);
    return registration.measure({events_, kNow, kSpan_s, samples_, covariance_});
  }

  EventRegistrationConfig config_;  ///< as it ships
  std::vector<ContourSample> samples_;
  std::vector<FilteredEvent> events_;
  Matrix6d covariance_;
};

double solved(const RegistrationResult& r, int i) { return r.vector(i) / r.information(i, i); }

TEST_F(EventRegistrationLaws, AShiftOfTheContoursIsFoundInEachDirection) {
  // Lines along the pixel grid put every event exactly where it belongs.
  add_line({100, 40}, {1, 0}, 0);
  add_line({40, 200}, {0, -1}, 0);
  for (auto& s : samples_) s.pixel -= 0.2 * Eigen::Vector2d(1, 1);  // the prediction is off by so much
  draw_events(0);
  for (auto& e : events_) EXPECT_TRUE(e.x > 0);
  const RegistrationResult r = measure();
  EXPECT_EQ(r.inliers, 40);
  // The contours have to move by +0.2 px along x and along y.
  EXPECT_NEAR(solved(r, 0) * kFocal, 0.2, 0.04);
  EXPECT_NEAR(solved(r, 1) * kFocal, 0.2, 0.04);
}

TEST_F(EventRegistrationLaws, EventsOfAnyAgeMeetTheContourWhereItWasThen) {
  // 2 px in the span; its events come behind it, as those of a contour that is not known yet.
  add_line({150 + ContrastMemory::kUnknownDelay_px, 40}, {1, 0}, 500);
  for (double age : {0.0, 0.002, 0.004}) add_event({150 - 500 * age, 60}, age);
  const RegistrationResult r = measure();
  EXPECT_EQ(r.events, 3);
  EXPECT_LT(r.residual, 3e-5);
}

TEST_F(EventRegistrationLaws, AccelerationOfTheContourCounts) {
  add_line({150 + ContrastMemory::kUnknownDelay_px, 40}, {1, 0}, 500);
  for (auto& s : samples_) s.curvature_px_s2 = 62'500;  // 1 px at 4 ms
  add_event({149, 60}, 0.004);                          // 150 - 2 + 1
  const RegistrationResult r = measure();
  EXPECT_EQ(r.events, 1);
  EXPECT_LT(r.residual, 3e-5);
}

TEST_F(EventRegistrationLaws, EdgeDelayIsTakenOffInTheDirectionOfMotion) {
  for (double speed : {400.0, -400.0}) {
    samples_.clear();
    events_.clear();
    add_line({150 + std::copysign(ContrastMemory::kUnknownDelay_px, speed), 40}, {1, 0}, speed);
    add_event({150, 60}, 0);  // behind the contour by the delay of one that is not known yet
    EXPECT_LT(measure().residual, 1e-5) << speed;
  }
}

TEST_F(EventRegistrationLaws, GateOpensWithTheMapsSigmaAndNotWithThePredictions) {
  add_line({150, 40}, {1, 0}, 0);
  add_event({152, 60}, 0);
  EXPECT_EQ(measure().events, 0);
  covariance_(0, 0) = std::pow(10.0 / kFocal, 2);
  EXPECT_EQ(measure().events, 0);
  for (auto& s : samples_) s.map_sigma_px = 1;
  EXPECT_EQ(measure().events, 1);
}

TEST_F(EventRegistrationLaws, EventsSpreadEvenlyDoNotCountAsConsistent) {
  add_line({150, 20}, {1, 0.3}, 0, 50);
  std::mt19937 random(4);
  for (int i = 0; i < 100'000; ++i)
    add_event({80.0 + static_cast<double>(random() % 81), 20.0 + static_cast<double>(random() % 200)}, 0);
  const RegistrationResult spread = measure();
  EXPECT_FALSE(spread.consistent);
  // Nearly nothing is known of where the contour is, and of that the mean of all of them tells little.
  config_.gate_truncation_correction = false;
  const double c = spread.gate_concentration;
  EXPECT_LT(c, 0.25);
  EXPECT_NEAR(spread.information(0, 0) / measure().information(0, 0), c * std::pow(c / 0.5, 2), 1e-9);
}

TEST_F(EventRegistrationLaws, ConcentrationOfEventsOnTheContourIsThatOfNoGate) {
  add_line({150, 20}, {1, 0}, 0, 50);
  for (int i = 0; i < 2000; ++i) add_event({150, 20.0 + i % 190}, 0);
  const RegistrationResult honest = measure();
  EXPECT_TRUE(honest.consistent);
  config_.gate_truncation_correction = false;
  EXPECT_NEAR(honest.information(0, 0) / measure().information(0, 0), 1, 1e-9);
}

TEST_F(EventRegistrationLaws, WrongPolaritiesAreLeftOutOnceContrastIsKnown) {
  EventRegistration registration({320, 240}, config_);
  add_line({150, 20}, {1, 0}, 500, 50);
  for (auto& s : samples_) s.speed_sigma_px_s = 10;
  for (unsigned seed : {1, 2, 3}) draw_events(0, seed);
  for (auto& e : events_) e.on = 1;  // getting brighter as it comes: dark in front
  for (int k = 0; k < 4; ++k)
    EXPECT_EQ(registration.measure({events_, kNow, kSpan_s, samples_, covariance_}).wrong_polarity, 0);
  for (auto& e : events_) e.on = 0;
  const RegistrationResult wrong = registration.measure({events_, kNow, kSpan_s, samples_, covariance_});
  EXPECT_GT(wrong.wrong_polarity, 100);
  // In the buffer zone both polarities count.
  for (auto& s : samples_) s.speed_sigma_px_s = 1000;
  EXPECT_EQ(registration.measure({events_, kNow, kSpan_s, samples_, covariance_}).wrong_polarity, 0);
}

TEST_F(EventRegistrationLaws, TheMapsContrastPredictsPolaritiesFromTheFirstEventOn) {
  add_line({150, 20}, {1, 0}, 500, 50);
  for (auto& s : samples_) s.speed_sigma_px_s = 10;
  draw_events(0);
  for (const int contrast : {-1, 0, 1})
    for (const int side : {-1, 1}) {
      for (auto& s : samples_) s.normal_side = side;
      for (auto& e : events_) e.on = 1;  // getting brighter as it comes: dark in front
      EventRegistration registration({320, 240}, config_);
      registration.seed_contrast(0, contrast);
      const RegistrationResult r = registration.measure({events_, kNow, kSpan_s, samples_, covariance_});
      EXPECT_EQ(r.wrong_polarity > 100, side * contrast > 0) << contrast << ' ' << side;
      EXPECT_EQ(r.events > 100, side * contrast <= 0) << contrast << ' ' << side;
    }
}

TEST_F(EventRegistrationLaws, EventsBetweenTwoContoursAreLeftOut) {
  config_.gate_px = 2;
  add_line({150, 40}, {1, 0}, 0);
  add_event({151, 60}, 0);
  EXPECT_EQ(measure().events, 1);
  add_line({152, 40}, {1, 0}, 0);
  EXPECT_EQ(measure().events, 0);
}

TEST_F(EventRegistrationLaws, UniformClutterPullsNowhere) {
  config_.gate_px = 3;
  add_line({150.3, 20}, {1, 0}, 0, 50);
  std::mt19937 random(4);
  for (int i = 0; i < 200'000; ++i)
    add_event({140.0 + static_cast<double>(random() % 21), 20.0 + static_cast<double>(random() % 200)}, 0);
  EXPECT_NEAR(solved(measure(), 0) * kFocal, 0, 0.05);
}

TEST_F(EventRegistrationLaws, AnEdgeAmongTextureCountsForLess) {
  config_.polarity_tells_clutter = true;
  for (const int texture : {0, 1, 3}) {  // events of each polarity for every one of the edge
    samples_.clear(), events_.clear();
    add_line({100, 20}, {1, 0}, 500, 40);
    add_line({220, 20}, {1, 0}, 500, 40);
    for (std::size_t i = 40; i < samples_.size(); ++i) samples_[i].segment = 1;
    draw_events(0);
    for (auto& e : events_) e.on = 1;
    const std::vector<FilteredEvent> edges = events_;
    for (const FilteredEvent& e : edges)
      for (int k = 0; e.x > 160 && k < 2 * texture; ++k) {
        events_.push_back(e);
        events_.back().on = k % 2 == 0 ? 1 : 0;
      }
    EventRegistration registration({320, 240}, config_, 2);
    for (int k = 0; k < 20; ++k) registration.measure({events_, kNow, kSpan_s, samples_, covariance_});
    double weight[2] = {0, 0};
    for (const SampleOffset& o : registration.offsets()) weight[samples_[o.sample].segment] += o.weight;
    if (texture == 0) {
      EXPECT_NEAR(weight[1], weight[0], 0.02 * weight[0]);
    }
    // Not told apart, three or seven events in place of one would count for more.
    EXPECT_LT(weight[1], (texture == 3 ? 0.3 : 1.02) * weight[0]);
  }
}

TEST_F(EventRegistrationLaws, InformationOfOneClusterIsBounded) {
  add_line({150, 33}, {1, 0}, 0, 4);
  std::vector<double> information;
  for (int n : {1, 10, 100, 10'000}) {
    events_.clear();
    for (int i = 0; i < n; ++i) add_event({150, 33.0 + i % 12}, 0);
    information.push_back(measure().information(0, 0));
  }
  EXPECT_GT(information[1], information[0]);
  const double repeats = config_.correlation_time_s / kSpan_s;
  const double bound =
      kFocal * kFocal / (repeats * config_.correlated_sigma_px * config_.correlated_sigma_px);
  EXPECT_LT(information[3], bound);
  EXPECT_GT(information[3], 0.9 * bound * 0.99);
}

TEST_F(EventRegistrationLaws, NothingInNothingOut) {
  EXPECT_EQ(measure().information, Matrix6d::Zero());
  add_line({150, 40}, {1, 0}, 0);
  EXPECT_EQ(measure().information, Matrix6d::Zero());
  samples_.clear();
  add_event({150, 60}, 0);
  EXPECT_EQ(measure().events, 0);
}

/// Looked at as they come, with contours as they were expected, events say what they say of contours as they
/// are.
TEST_F(EventRegistrationLaws, EventsThatAreLookedAtAsTheyComeSayTheSame) {
  config_.gate_truncation_correction = false;  // events at the gate itself decide it
  add_line({150, 20}, {1, 0.4}, 300, 40);
  add_line({60, 200}, {0.2, -1}, -200, 40);
  for (unsigned seed : {1, 2, 3, 4, 5, 6}) draw_events(0.1, seed);
  std::stable_sort(events_.begin(), events_.end(),
                   [](const auto& a, const auto& b) { return a.stamp_us < b.stamp_us; });
  const RegistrationResult batch = measure();
  ForecastError error;
  error.pose.head<2>() = Eigen::Vector2d(0.15, -0.1) / kFocal;
  error.velocity.head<2>() = Eigen::Vector2d(12, 8) / kFocal;
  std::vector<ContourSample> expected = samples_;
  for (ContourSample& s : expected) {  // as the error's removal would move them
    s.pixel += s.jacobian.head<2>().dot(error.pose.head<2>()) * s.normal_px;
    s.speed_px_s += s.jacobian.head<3>().dot(error.velocity);
  }
  for (const std::size_t piece : {1UL, 7UL, 100UL, events_.size()}) {
    EventRegistration registration({320, 240}, config_);
    InterestMap interest(320, 240);
    ASSERT_TRUE(registration.expect({expected, kSpan_s}, &interest));
    std::vector<FilteredEvent> come;
    for (std::size_t i = 0; i < events_.size(); ++i) {
      if (interest.holds(events_[i].x, events_[i].y)) come.push_back(events_[i]);
      if (i % piece == 0) registration.look_at(come, kNow);
    }
    RegistrationProblem problem{come, kNow, kSpan_s, expected, covariance_};
    problem.forecast = error;
    const RegistrationResult r = registration.measure(problem);
    EXPECT_NEAR(r.events, batch.events, 0.02 * batch.events) << piece;
    EXPECT_NEAR(r.residual, batch.residual, 0.02 * batch.residual) << piece;
    for (int i : {0, 1}) EXPECT_NEAR(solved(r, i) * kFocal, solved(batch, i) * kFocal, 0.01) << piece;
  }
}

/// Over the turns, the estimates from a share of the blocks are those from all, each says less, and together
/// they say no more.
TEST_F(EventRegistrationLaws, ThinnedByBlocksTheEstimateIsUnbiasedAndSaysAsMuchLess) {
  config_.gate_px = 1;  // in which events that are rounded to whole pixels gather
  for (double x : {75.0, 130.0, 190.0, 250.0, 300.0}) add_line({x, 20}, {1, 0.3}, 150, 45);
  for (double y : {50.0, 120.0, 190.0}) add_line({300, y}, {0.1, 1}, -120, 60);
  for (unsigned seed : {1, 2, 3, 4}) draw_events(0.12, seed);
  const RegistrationResult whole = measure();
  for (const double share : {0.15, 0.5}) {
    constexpr int kTurns = 200;
    Matrix6d information = Matrix6d::Zero();
    Vector6d vector = Vector6d::Zero();
    int events = 0;
    for (int turn = 0; turn < kTurns; ++turn) {
      EventRegistration registration({320, 240}, config_);
      InterestMap interest(320, 240);
      const BlockThinning thinning({320, 240}, share, turn);
      ASSERT_TRUE(registration.expect({samples_, kSpan_s, thinning}, &interest));
      std::vector<FilteredEvent> come;
      for (const FilteredEvent& e : events_)
        if (interest.holds(e.x, e.y)) come.push_back(e);
      EXPECT_LT(interest.share(), 0.8);
      RegistrationProblem problem{come, kNow, kSpan_s, samples_, covariance_};
      problem.forecast = ForecastError{};
      problem.thinning = thinning;
      const RegistrationResult r = registration.measure(problem);
      information += r.information, vector += r.vector;
      events += r.events;
    }
    EXPECT_NEAR(events, share * kTurns * whole.events, 0.02 * share * kTurns * whole.events);
    for (int i : {0, 1}) {
      EXPECT_NEAR(vector(i) / information(i, i), solved(whole, i), 0.02 * std::abs(solved(whole, i)));
      // An error that a cell's events share for some updates is met as often less: its cap counts for the
      // share.
      const double said = information(i, i) / (kTurns * whole.information(i, i));
      EXPECT_GT(said, 0.98 * share);
      EXPECT_LT(said, 1.02);
    }
  }
}

TEST_F(EventRegistrationLaws, BandsAreReleasedAfterEachCall) {
  EventRegistration registration({320, 240}, config_);
  add_line({150, 40}, {1, 0}, 0);
  add_event({150, 60}, 0);
  EXPECT_EQ(registration.measure({events_, kNow, kSpan_s, samples_, covariance_}).events, 1);
  const std::vector<ContourSample> none;
  EXPECT_EQ(registration.measure({events_, kNow, kSpan_s, none, covariance_}).events, 0);
}

}  // namespace
}  // namespace evpose
