// SPDX-License-Identifier: BSD-3-Clause
// The search for a lost pose in a world of boxes of glass, whose edges make exact events.
#include "evpose/tracker/relocalizer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "evpose/tracker/test_flight.h"
#include "evpose/tracker/tracker.h"

namespace evpose {
namespace {

using test_flight::kStart_ns;
using test_flight::pose_at;

constexpr double kFlight_s = 1.6;
constexpr double kUpdate_s = 3e-3;
constexpr double kPositionError_m = 0.2, kRotationError_rad = 5 * std::numbers::pi / 180;
constexpr unsigned kStarts = 6;

/// Straight edges of random directions where the boxes are: another place.
ContourMap sticks() {
  ContourMap map;
  std::mt19937 random(11);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) + 0.5) / 4294967296.0;
  };
  for (int i = 0; i < 150; ++i) {
    const Eigen::Vector3d from(uniform(3, 5.5), uniform(1, 5), uniform(0.2, 2.8));
    const Eigen::Vector3d along(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    test_flight::add_edge(map, from, from + 0.5 * along.normalized());
  }
  return map;
}

std::vector<test_flight::TimedEvent> record(const ContourMap& world, const Camera& camera) {
  std::vector<test_flight::TimedEvent> out = test_flight::record(world, camera, kFlight_s);
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.t_s < b.t_s; });
  return out;
}

std::span<test_flight::TimedEvent> between(std::vector<test_flight::TimedEvent>& events, double from_s,
                                           double to_s) {
  const auto before = [](const test_flight::TimedEvent& e, double t_s) { return e.t_s < t_s; };
  const auto first = std::lower_bound(events.begin(), events.end(), from_s, before);
  return {first, std::lower_bound(first, events.end(), to_s, before)};
}

/// A time of the flight, and a pose off the true one by the errors of this test in random directions.
struct PoorStart {
  explicit PoorStart(unsigned seed) {
    std::mt19937 random(seed);
    const auto uniform = [&random] { return (static_cast<double>(random()) + 0.5) / 4294967296.0; };
    const auto direction = [&] {
      const double z = 2 * uniform() - 1, a = 2 * std::numbers::pi * uniform(), r = std::sqrt(1 - z * z);
      return Eigen::Vector3d(r * std::cos(a), r * std::sin(a), z);
    };
    t_s = 0.05 + 1.1 * uniform();
    Vector6d error;
    error.head<3>() = kPositionError_m * direction();
    error.tail<3>() = kRotationError_rad * direction();
    T_map_body = pose_at(t_s).plus(error);
  }
  double t_s;
  Pose T_map_body;
};

/// Per axis, of PoorStart's errors.
constexpr double kStartSigma_m = kPositionError_m / std::numbers::sqrt3,
                 kStartSigma_rad = kRotationError_rad / std::numbers::sqrt3;

class RelocalizerLaws : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    camera_ = test_flight::make_flight_camera();
    world_ = std::make_shared<const ContourMap>(test_flight::boxes());
    other_ = std::make_shared<const ContourMap>(sticks());
    events_ = record(*world_, *camera_);
  }

  struct Outcome {
    bool found = false;
    double t_s = 0;                ///< when it was found, or the search was given up
    std::vector<Pose> candidates;  ///< then
    Relocalizer::Found state;
    double position_error_m() const { return (state.nav.T_map_body.p - pose_at(t_s).p).norm(); }
    double rotation_error_rad() const { return state.nav.T_map_body.minus(pose_at(t_s)).tail<3>().norm(); }
    double velocity_error_m_s() const { return (state.nav.velocity - test_flight::velocity_at(t_s)).norm(); }
    /// Within three of the standard deviations that the tracker is told, in each of the three axes.
    bool within_sigmas() const {
      const double bound = 3 * std::numbers::sqrt3;
      return found && position_error_m() < bound * Relocalizer::kFoundPositionSigma_m &&
             rotation_error_rad() < bound * Relocalizer::kFoundRotationSigma_rad &&
             velocity_error_m_s() < bound * Relocalizer::kFoundVelocitySigma_m_s;
    }
  };

  /// Searches from a poor start, of unknown velocity, in events of world_, for so long.
  Outcome search(unsigned seed, const ContourMap& map, double seconds) const {
    return search(PoorStart(seed), kStartSigma_m, kStartSigma_rad, map, seconds);
  }
  Outcome search(const PoorStart& start, double sigma_m, double sigma_rad, const ContourMap& map,
                 double seconds) const {
    const ContourIndex index(map);
    const ContourSegments segments = cut_into_segments(map);
    Relocalizer relocalizer({index, segments, *camera_, {0, 0, -9.81}, visible_, registration_});
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal().head<3>().setConstant(sigma_m * sigma_m);
    covariance.diagonal().tail<3>().setConstant(sigma_rad * sigma_rad);
    relocalizer.begin_search(time(start.t_s), {start.T_map_body}, covariance, start_was_wrong_);
    for (int i = 0; i * kUpdate_s < seconds; ++i) {
      const double from_s = start.t_s + i * kUpdate_s, to_s = from_s + kUpdate_s;
      const ImuIncrement motion = motion_between(from_s, to_s);
      const Eigen::Vector3d rate = test_flight::imu_at(to_s).gyro;
      auto events = front_events(from_s, to_s);
      if (i * kUpdate_s < covered_s_)
        std::erase_if(events, [](const FilteredEvent& e) { return e.x > 2 * camera_->size().width / 3; });
      if (const auto found =
              relocalizer.process({time(to_s), now_us(to_s), events, motion, rate, T_body_cam_}))
        return {true, to_s, {}, *found};
    }
    return {false, start.t_s + std::ceil(seconds / kUpdate_s) * kUpdate_s, relocalizer.candidates(), {}};
  }

  struct Run {
    int threads = 1, packet_ms = 1;
    PoorStart start = PoorStart(1);
    std::shared_ptr<const ContourMap> map = world_;
    double silent_from_s = 1e9;  ///< since its start; no events from then on
  };
  /// What the tracker says from a poor start, for so long.
  std::vector<Update> track(const Run& run, double seconds) const {
    const PoorStart& poor = run.start;
    auto tracker = make_tracker(poor, run.map, run.threads);
    std::vector<Update> updates;
    tracker->on_update([&](const Update& u) { updates.push_back(u); });
    int imu = -1, packets = static_cast<int>(std::lround(1e3 * seconds)) / run.packet_ms;
    for (int i = 0; i < packets; ++i) {
      const double from_s = poor.t_s + 1e-3 * run.packet_ms * i,
                   to_s = poor.t_s + 1e-3 * run.packet_ms * (i + 1);
      for (; imu <= run.packet_ms * (i + 1); ++imu)
        tracker->add_imu(test_flight::imu_at(poor.t_s + test_flight::kImuPeriod_s * imu));
      const bool silent = from_s - poor.t_s >= run.silent_from_s;
      const EventPacket packet =
          silent ? EventPacket{} : test_flight::make_packet(between(events_, from_s, to_s), from_s);
      if (!packet.empty()) tracker->add_events(packet);
      if (silent) tracker->events_complete_until(time(to_s));
    }
    return updates;
  }
  /// No point of the map is registered while the pose is searched.
  static bool searching(const Update& u) { return u.points == 0; }

  std::unique_ptr<Tracker> make_tracker(const PoorStart& poor, std::shared_ptr<const ContourMap> map,
                                        int threads) const {
    TrackerSetup setup;
    setup.camera = camera_;
    setup.T_body_cam = test_flight::camera_on_body();
    setup.imu_noise.rate_hz = 1 / test_flight::kImuPeriod_s;
    setup.map = std::move(map);
    TrackerConfig config;
    config.threads = threads;
    config.visible = visible_;
    config.fusion.start_position_sigma_m = kStartSigma_m;
    config.fusion.start_rotation_sigma_rad = kStartSigma_rad;
    StartState start;
    start.t = time(poor.t_s);
    start.T_map_body = poor.T_map_body;
    return std::move(Tracker::create(setup, config, start)).value();
  }

  static TimeNs time(double t_s) { return kStart_ns + from_seconds(t_s); }
  static std::uint32_t now_us(double t_s) { return static_cast<std::uint32_t>(std::lround(1e6 * (1 + t_s))); }
  static std::vector<FilteredEvent> front_events(double from_s, double to_s) {
    std::vector<FilteredEvent> out;
    for (const test_flight::TimedEvent& e : between(events_, from_s, to_s)) {
      FilteredEvent f{};
      f.stamp_us = now_us(e.t_s);
      f.x = e.event.x;
      f.y = e.event.y;
      f.on = e.event.on;
      out.push_back(f);
    }
    return out;
  }
  static ImuIncrement motion_between(double from_s, double to_s) {
    ImuIncrement out;
    const int steps = static_cast<int>(std::lround((to_s - from_s) / test_flight::kImuPeriod_s));
    for (int i = 0; i < steps; ++i) {
      const double t_s = from_s + i * test_flight::kImuPeriod_s;
      out = joined(out,
                   integrate(test_flight::imu_at(t_s), test_flight::imu_at(t_s + test_flight::kImuPeriod_s),
                             Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()));
    }
    return out;
  }

  inline static std::shared_ptr<const Camera> camera_;
  inline static std::shared_ptr<const ContourMap> world_, other_;
  inline static std::vector<test_flight::TimedEvent> events_;
  VisibleSetConfig visible_;
  EventRegistrationConfig registration_;
  Pose T_body_cam_ = test_flight::camera_on_body();
  double covered_s_ = 0;          ///< of a search: without events of the image's right third
  bool start_was_wrong_ = false;  ///< likewise: the search knows that
};

TEST_F(RelocalizerLaws, FindsThePoseFromPoorStartsWithinItsSigmas) {
  for (unsigned seed = 1; seed <= kStarts; ++seed) {
    const Outcome outcome = search(seed, *world_, 0.25);
    EXPECT_TRUE(outcome.within_sigmas())
        << "seed " << seed << ": found " << outcome.found << ", off by " << outcome.position_error_m()
        << " m, " << outcome.rotation_error_rad() << " rad, " << outcome.velocity_error_m_s() << " m/s";
  }
}

TEST_F(RelocalizerLaws, InAMapThatMayBeWrongAPoseIsTakenThatSearchesInLaterEventsFindToo) {
  ContourMap map = *world_;
  for (ContourPoint& p : map.points) p.sigma = 1e-3F;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const Outcome once = search(seed, *world_, 0.6), competing = search(seed, map, 0.6);
    ASSERT_TRUE(once.found && competing.found) << seed;
    EXPECT_GT(competing.t_s, once.t_s) << seed;
    EXPECT_TRUE(competing.within_sigmas()) << seed << ": off by " << competing.position_error_m() << " m";
  }
}

TEST_F(RelocalizerLaws, FindsThePoseFromMetresOffWithAnyHeading) {
  PoorStart start(2);
  ContourMap map = *world_;  // with something behind the flight: it is searched among the contours
  test_flight::add_edge(map, {-0.5, 1, 0.2}, {-0.5, 5, 0.2});
  for (const double heading : {2.1, -0.7}) {
    start.T_map_body = pose_at(start.t_s);
    start.T_map_body.p += Eigen::Vector3d(-0.9, 1.1, 0.6);
    start.T_map_body.q = so3::exp({0, 0, heading}) * start.T_map_body.q;
    const Outcome outcome = search(start, 1, std::numbers::pi, map, 0.4);
    EXPECT_TRUE(outcome.within_sigmas())
        << "heading " << heading << ": found " << outcome.found << ", off by " << outcome.position_error_m()
        << " m, " << outcome.rotation_error_rad() << " rad, " << outcome.velocity_error_m_s() << " m/s";
  }
}

TEST_F(RelocalizerLaws, RefusesTheMapOfAnotherPlaceAtAnyHeading) {
  EXPECT_FALSE(search(PoorStart(1), 1, std::numbers::pi, *other_, 0.15).found);
}

TEST_F(RelocalizerLaws, RefusesTheMapOfAnotherPlace) {
  for (unsigned seed = 1; seed <= 3; ++seed) EXPECT_FALSE(search(seed, *other_, 0.15).found) << seed;
}

const Eigen::Vector3d kTwin(0, 0.3, 0);

PoorStart between_twins() {
  PoorStart start(1);
  start.T_map_body = pose_at(start.t_s);
  start.T_map_body.p += kTwin / 2;
  return start;
}

TEST_F(RelocalizerLaws, PosesThatExplainTheEventsAlikeAreCandidatesAndNoneIsTaken) {
  const Outcome outcome = search(between_twins(), 0.1, 0.01, test_flight::with_twins(*world_, kTwin), 0.4);
  EXPECT_FALSE(outcome.found);
  ASSERT_EQ(outcome.candidates.size(), 2U);
  const Eigen::Vector3d &p = outcome.candidates[0].p, &q = outcome.candidates[1].p;
  EXPECT_NEAR((p - q).norm(), kTwin.norm(), 0.01);
  const Eigen::Vector3d truth = pose_at(outcome.t_s).p;
  EXPECT_LT(std::min((p - truth).norm(), (q - truth).norm()), 0.01);
}

TEST_F(RelocalizerLaws, MotionDecidesBetweenPosesThatExplainedTheEventsAlike) {
  const ContourMap map = test_flight::with_twins(*world_, kTwin, 2);
  covered_s_ = 0.25;
  EXPECT_EQ(search(between_twins(), 0.1, 0.01, map, covered_s_).candidates.size(), 2U);
  const Outcome outcome = search(between_twins(), 0.1, 0.01, map, 2 * covered_s_);
  EXPECT_TRUE(outcome.within_sigmas()) << outcome.position_error_m();
  EXPECT_GT(outcome.t_s, between_twins().t_s + covered_s_);
}

TEST_F(RelocalizerLaws, NearAStartThatWasWrongTheTruePoseIsFoundWhereThePlaceRepeats) {
  const Eigen::Vector3d period(0, 1.1, 0);
  PoorStart start(1);
  start.T_map_body = pose_at(start.t_s);
  start.T_map_body.p += period;
  const ContourMap map = test_flight::with_twins(*world_, period, 2);
  const Outcome alias = search(start, 0.05, 0.01, map, 0.25);
  ASSERT_TRUE(alias.found);
  EXPECT_NEAR(alias.position_error_m(), period.norm(), 0.05);
  start_was_wrong_ = true;
  const Outcome outcome = search(start, 0.05, 0.01, map, 0.5);
  EXPECT_TRUE(outcome.within_sigmas())
      << "found " << outcome.found << ", off by " << outcome.position_error_m() << " m, candidates "
      << outcome.candidates.size();
}

TEST_F(RelocalizerLaws, TheTrackerTellsWhichPosesAreAmbiguous) {
  const auto map = std::make_shared<const ContourMap>(test_flight::with_twins(*world_, kTwin));
  const auto updates = track({.start = between_twins(), .map = map}, 0.35);
  EXPECT_EQ(updates.back().health, Health::ambiguous);
  EXPECT_EQ(updates.back().candidates.size(), 2U);
  const auto first = std::ranges::find(updates, Health::ambiguous, &Update::health);
  EXPECT_TRUE(first->reason.starts_with("2 poses explain the events alike: (")) << first->reason;
  for (const Update& u : updates) EXPECT_NE(u.health, Health::tracking);
}

TEST_F(RelocalizerLaws, SettingsOfVisiblePointsReachTheSearch) {
  visible_.near_m = 20;  // further than any contour
  EXPECT_FALSE(search(1, *world_, 0.25).found);
}

TEST_F(RelocalizerLaws, TheCameraIsWhereEachCallSays) {
  T_body_cam_.p.z() += 0.1;
  const Outcome outcome = search(1, *world_, 0.25);
  ASSERT_TRUE(outcome.found);
  const Pose camera_found = outcome.state.nav.T_map_body * T_body_cam_;
  const Pose camera_true = pose_at(outcome.t_s) * test_flight::camera_on_body();
  EXPECT_LT((camera_found.p - camera_true.p).norm(), 0.02);
  EXPECT_GT(outcome.position_error_m(), 0.08);
}

TEST_F(RelocalizerLaws, ThreadsAndPacketsMakeNoDifferenceToASearch) {
  const auto one = track({.threads = 1, .packet_ms = 1}, 0.2),
             other = track({.threads = 3, .packet_ms = 8}, 0.2);
  ASSERT_EQ(one.size(), other.size());
  EXPECT_TRUE(searching(one.front()));
  EXPECT_FALSE(searching(one.back()));
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].T_map_body.p, other[i].T_map_body.p) << i;
    EXPECT_EQ(one[i].T_map_body.q.coeffs(), other[i].T_map_body.q.coeffs()) << i;
    EXPECT_EQ(one[i].covariance, other[i].covariance) << i;
    EXPECT_EQ(one[i].health, other[i].health) << i;
  }
}

TEST_F(RelocalizerLaws, APoseFoundIsVerifiedBeforeItIsCalledTracking) {
  const auto updates = track({}, 0.5);
  const auto found = std::find_if_not(updates.begin(), updates.end(), searching);
  const auto tracking = std::find_if(updates.begin(), updates.end(),
                                     [](const Update& u) { return u.health == Health::tracking; });
  ASSERT_NE(found, updates.end());
  ASSERT_NE(tracking, updates.end());
  EXPECT_GE(to_seconds(tracking->t - found->t), Relocalizer::kVerify_s - 1e-6);
}

/// Others may explain the events as well: only the time for which they go on to agree tells.
TEST_F(RelocalizerLaws, TheSigmaOfAPoseFoundFallsWhileEventsConfirmIt) {
  const auto updates = track({}, 0.8);
  const auto first = std::ranges::find(updates, Health::tracking, &Update::health);
  ASSERT_NE(first, updates.end());
  const auto sigma_m = [](const Update& u) { return std::sqrt(u.covariance(0, 0)); };
  EXPECT_GT(sigma_m(*first), 0.015);
  const double elapsed_s = to_seconds(updates.back().t - first->t);
  EXPECT_GT(elapsed_s, 0.25);
  EXPECT_NEAR(sigma_m(updates.back()) / sigma_m(*first), std::exp(-elapsed_s / 0.5), 0.1);
}

TEST_F(RelocalizerLaws, SilenceDoesNotConfirmAPoseThatWasFound) {
  Run run;
  const auto seen = track(run, 0.35);
  const auto found = std::find_if_not(seen.begin(), seen.end(), searching);
  ASSERT_NE(found, seen.end());
  run.silent_from_s = to_seconds(found->t - time(run.start.t_s)) + 0.08;
  const auto updates = track(run, run.silent_from_s + 0.4);
  ASSERT_GT(updates.back().t, found->t + from_seconds(0.3));
  for (const Update& u : updates) {
    EXPECT_NE(u.health, Health::tracking);
    EXPECT_GT(std::sqrt(u.covariance.topLeftCorner<3, 3>().trace()), 0.1) << to_seconds(u.t - found->t);
  }
}

TEST_F(RelocalizerLaws, TheTrackersSettingsReachItsSearch) {
  visible_.near_m = 20;  // further than any contour
  for (const Update& u : track({}, 0.2)) EXPECT_EQ(u.health, Health::initialising);
}

}  // namespace
}  // namespace evpose
