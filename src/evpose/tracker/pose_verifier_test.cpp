// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_verifier.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include "evpose/tracker/map_pager.h"
#include "evpose/tracker/test_flight.h"

namespace evpose {
namespace {

using test_flight::pose_at;

constexpr double kLook_s = 0.013;  // every few updates
constexpr double kUpdate_s = 3e-3, kFlight_s = 0.3;

class PoseVerifierLaws : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    camera_ = test_flight::make_flight_camera();
    world_ = test_flight::boxes();
    events_ = test_flight::record(world_, *camera_, kFlight_s);
  }

  /// What is said in the end of the events of world_ if `map` is believed, seen from a pose off the true one.
  static PoseVerdict verdict(const ContourMap& map, const Vector6d& off, bool silent = false,
                             bool flickers = false) {
    const ContourSegments segments = cut_into_segments(map);
    const Pose T_body_cam = test_flight::camera_on_body();
    const ContourView view{map, segments, *camera_, T_body_cam, 1e-3};
    std::vector<std::uint32_t> points(map.points.size());
    std::iota(points.begin(), points.end(), 0U);
    std::vector<ContourSample> samples;
    PoseVerifier verifier(camera_->size(), told_by_flights(map, segments), false);
    for (double t_s = kLook_s; t_s < kFlight_s; t_s += kLook_s) {
      const Eigen::Vector3d rate = test_flight::imu_at(t_s).gyro;
      project_contours(view, points, {pose_at(t_s).plus(off), test_flight::velocity_at(t_s), rate}, kUpdate_s,
                       samples);
      std::erase_if(samples, [](const ContourSample& s) { return !camera_->size().contains(s.pixel); });
      auto events = silent ? std::vector<FilteredEvent>{}
                           : test_flight::filtered_between(events_, t_s - kUpdate_s, t_s);
      if (flickers) events = with_flicker(std::move(events), t_s);
      verifier.add(events, samples, kUpdate_s, kLook_s);
    }
    return verifier.verdict();
  }

 private:
  /// Lamps brighten and darken 100 times a second: in two thirds of the time a tenth of the pixels have an
  /// event each millisecond.
  static std::vector<FilteredEvent> with_flicker(std::vector<FilteredEvent> events, double t_s) {
    std::mt19937 random(static_cast<unsigned>(1e6 * t_s));
    const ImageSize size = camera_->size();
    for (double at_s = t_s - kUpdate_s; at_s < t_s; at_s += 1e-4) {
      const double phase = 200 * at_s - std::floor(200 * at_s);
      if (phase < 0.33) continue;
      for (int i = 0; i < size.width * size.height / 100; ++i) {
        FilteredEvent f{};
        f.x = static_cast<std::uint16_t>(random() % static_cast<unsigned>(size.width));
        f.y = random() % static_cast<unsigned>(size.height) & 0x7FFFU;
        f.on = static_cast<unsigned>(200 * at_s) & 1U;
        f.stamp_us = static_cast<std::uint32_t>(1e6 * at_s);
        events.push_back(f);
      }
    }
    std::ranges::stable_sort(events, {}, &FilteredEvent::stamp_us);
    return events;
  }

 protected:
  inline static std::shared_ptr<const Camera> camera_;
  inline static ContourMap world_;
  inline static std::vector<test_flight::TimedEvent> events_;
};

TEST_F(PoseVerifierLaws, TheTruePoseIsConfirmed) {
  EXPECT_EQ(verdict(world_, Vector6d::Zero()), PoseVerdict::confirmed);
}

TEST_F(PoseVerifierLaws, LampsThatFlickerChangeNothing) {
  EXPECT_EQ(verdict(world_, Vector6d::Zero(), false, true), PoseVerdict::confirmed);
  Vector6d off = Vector6d::Zero();
  off.head<3>() << 0.1, -0.15, 0.1;
  EXPECT_EQ(verdict(world_, off, false, true), PoseVerdict::refuted);
}

TEST_F(PoseVerifierLaws, TheMapOfAnotherPlaceIsRefuted) {
  for (const unsigned seed : {4U, 5U, 6U, 7U})
    EXPECT_EQ(verdict(test_flight::boxes(seed), Vector6d::Zero()), PoseVerdict::refuted) << seed;
}

TEST_F(PoseVerifierLaws, AWrongPoseIsRefuted) {
  Vector6d off = Vector6d::Zero();
  off.head<3>() << 0.1, -0.15, 0.1;
  EXPECT_EQ(verdict(world_, off), PoseVerdict::refuted);
}

/// Only its contours along y are right: most events lie at these, which tell the height alone.
TEST_F(PoseVerifierLaws, AMapThatIsWrongInOneDirectionIsContested) {
  ContourMap map = world_;
  for (ContourPoint& p : map.points)
    if (std::abs(p.tangent.y()) < 0.9F) p.position.y() += 0.23F;
  EXPECT_EQ(verdict(map, Vector6d::Zero()), PoseVerdict::contested);
}

/// However many events lie on them.
TEST(PoseVerifierOfFewContours, ConfirmAPoseThatWasGivenButNotOneThatWasFound) {
  constexpr int kPieces = 60;
  std::vector<ContourSample> contours(kPieces);
  for (int i = 0; i < kPieces; ++i) {
    contours[i].pixel = {60 + 50 * (i % 10), 60 + 50 * (i / 10)};
    contours[i].normal_px = i % 2 == 0 ? Eigen::Vector2d::UnitX() : Eigen::Vector2d::UnitY();
    contours[i].speed_px_s = 300;
    contours[i].segment = static_cast<std::uint32_t>(i);
  }
  const auto looked_at = [&](int with_events) {
    PoseVerifier verifier({640, 480}, std::vector<bool>(kPieces), true);
    std::vector<FilteredEvent> events;
    for (int i = 0; i < with_events; ++i)
      for (int k = 0; k < 3; ++k) {
        FilteredEvent e{};
        // Beside the sample's middle: it is looked 1.5 px along the contour.
        e.x = static_cast<std::uint16_t>(contours[i].pixel.x() + 2 * contours[i].normal_px.y());
        e.y = static_cast<unsigned>(contours[i].pixel.y() + 2 * contours[i].normal_px.x()) & 0x7FFFU;
        events.push_back(e);
      }
    for (double t_s = 0; t_s < kFlight_s; t_s += kLook_s) verifier.add(events, contours, kUpdate_s, kLook_s);
    return verifier;
  };
  for (const int with_events : {9, 12, 40}) {
    const PoseVerifier verifier = looked_at(with_events);
    const PoseEvidence e = verifier.evidence();
    EXPECT_EQ(e.pieces, kPieces);
    EXPECT_NEAR(e.explained * e.pieces, with_events, 1e-6);
    EXPECT_GT(e.ratio, 10);
    EXPECT_EQ(verifier.verdict(), PoseVerdict::confirmed) << with_events;
    EXPECT_EQ(verifier.verdict_of_found(), with_events < 10 ? PoseVerdict::open : PoseVerdict::confirmed)
        << with_events;
  }
}

/// As after a jump: as many events beside the contours as on them, but for four contours, which make the
/// ratio.
TEST(PoseVerifierOfManyContours, RefuteAPoseThatHardlyOneOfThemConfirms) {
  constexpr int kColumns = 40;
  constexpr std::array<int, 4> kAside_px{-12, -7, 7, 12};
  constexpr int kTold = 200;
  const auto verdict_of = [&](int pieces, int explained, int first_told = -1) {
    std::vector<ContourSample> contours(static_cast<std::size_t>(pieces));
    for (int i = 0; i < pieces; ++i) {
      contours[i].pixel = {60 + 29 * (i % kColumns), 60 + 29 * (i / kColumns)};
      contours[i].normal_px = Eigen::Vector2d::UnitX();
      contours[i].speed_px_s = 300;
      contours[i].segment = static_cast<std::uint32_t>(i);
    }
    std::vector<bool> told(static_cast<std::size_t>(pieces));
    for (int i = 0; first_told >= 0 && i < kTold; ++i) told[static_cast<std::size_t>(first_told + i)] = true;
    PoseVerifier verifier({1280, 720}, told, true);
    for (int k = 0; k * kLook_s < kFlight_s; ++k) {
      std::vector<FilteredEvent> events;
      const auto add = [&](const ContourSample& contour, int aside_px, int count) {
        FilteredEvent e{};
        e.x = static_cast<std::uint16_t>(contour.pixel.x() + aside_px);
        e.y = static_cast<unsigned>(contour.pixel.y() + 2) & 0x7FFFU;
        events.insert(events.end(), static_cast<std::size_t>(count), e);
      };
      for (int i = 0; i < pieces; ++i) add(contours[i], kAside_px[k % 4], 1);
      for (int i = 0; i < explained; ++i) add(contours[i], 0, pieces / 2 / explained);
      verifier.add(events, contours, kUpdate_s, kLook_s);
    }
    EXPECT_NEAR(verifier.evidence().ratio, first_told < 0 ? 2 : first_told == 0 ? 6 : 0, 0.5);
    return verifier.verdict();
  };
  EXPECT_EQ(verdict_of(600, 4), PoseVerdict::refuted);
  EXPECT_EQ(verdict_of(200, 4), PoseVerdict::open);
  EXPECT_EQ(verdict_of(600, 30), PoseVerdict::open);
  // What flights have told is asked alone, for and against the pose.
  EXPECT_EQ(verdict_of(600, 30, 0), PoseVerdict::confirmed);
  EXPECT_EQ(verdict_of(600, 30, 200), PoseVerdict::refuted);
}

TEST_F(PoseVerifierLaws, WithoutEventsNothingIsSaid) {
  EXPECT_EQ(verdict(world_, Vector6d::Zero(), true), PoseVerdict::open);
}

TEST_F(PoseVerifierLaws, WithoutContoursNothingIsSaid) {
  ContourMap behind = world_;
  for (ContourPoint& p : behind.points) p.position.x() -= 20;
  EXPECT_EQ(verdict(behind, Vector6d::Zero()), PoseVerdict::open);
}

}  // namespace
}  // namespace evpose
