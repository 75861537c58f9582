// SPDX-License-Identifier: BSD-3-Clause
// Poses found beside a stream, in a world of boxes of glass, whose edges make exact events.
#include "evpose/serve/recovery.h"

#include <gtest/gtest.h>

#include <future>
#include <thread>

#include "evpose/serve/session.h"
#include "evpose/tracker/test_flight.h"

namespace evpose {
namespace {

using test_flight::kStart_ns;
using test_flight::pose_at;

constexpr double kFlight_s = 1.5;
constexpr double kSigma_m = 0.15, kSigma_rad = 0.05;
const Vector6d kOff = (Vector6d() << 0.12, -0.1, 0.08, 0.02, 0.03, -0.04).finished();

TimeNs time(double t_s) { return kStart_ns + from_seconds(t_s); }
double flight_time(TimeNs t) { return to_seconds(t - kStart_ns); }
double error_m(const Update& u) { return (u.T_map_body.p - pose_at(flight_time(u.t)).p).norm(); }

class RecoveryLaws : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    world_ = std::make_shared<const ContourMap>(test_flight::boxes());
    other_ = std::make_shared<const ContourMap>(test_flight::boxes(77));
    const auto camera = test_flight::make_flight_camera();
    test_flight::EdgeEvents edges(*world_, *camera);
    for (int i = 0; i * test_flight::EdgeEvents::kStep_s < kFlight_s; ++i)
      edges.advance(i * test_flight::EdgeEvents::kStep_s, false, events_);
    std::sort(events_.begin(), events_.end(), [](const auto& a, const auto& b) { return a.t_s < b.t_s; });
  }
  RecoveryLaws() {
    setup_.camera = test_flight::make_flight_camera();
    setup_.T_body_cam = test_flight::camera_on_body();
    setup_.imu_noise.rate_hz = 1 / test_flight::kImuPeriod_s;
    setup_.map = world_;
  }

  static EventPacket packet(double from_s, double to_s) {
    const auto before = [](const test_flight::TimedEvent& e, double t_s) { return e.t_s < t_s; };
    const auto first = std::lower_bound(events_.begin(), events_.end(), from_s, before);
    return test_flight::make_packet({first, std::lower_bound(first, events_.end(), to_s, before)}, from_s);
  }
  static TrackerStart start_off(double t_s) {
    return {{time(t_s), pose_at(t_s).plus(kOff)}, kSigma_m, kSigma_rad};
  }

  /// Milliseconds of both streams; `each` is called after each packet.
  template <typename Imu, typename Events>
  static void feed(double from_s, double to_s, int packet_ms, Imu add_imu, Events add_events) {
    const int packets = static_cast<int>(std::lround(1e3 * (to_s - from_s))) / packet_ms;
    int sample = 0;
    for (int i = 0; i < packets; ++i) {
      for (; sample <= packet_ms * (i + 1); ++sample)
        add_imu(test_flight::imu_at(from_s + test_flight::kImuPeriod_s * sample));
      add_events(packet(from_s + 1e-3 * packet_ms * i, from_s + 1e-3 * packet_ms * (i + 1)));
    }
  }

  TrackerSetup setup_;
  static inline std::shared_ptr<const ContourMap> world_, other_;
  static inline std::vector<test_flight::TimedEvent> events_;
};

/// When it was found, and how the tracker went on.
struct Found {
  double at_s = -1;
  std::vector<Update> updates;
};

class RecoveryOfPackets : public RecoveryLaws {
 protected:
  Found find(int packet_ms) {
    TrackerStart start = start_off(0.1);
    start.searches = true;
    Recovery recovery([&] { return make_tracker(setup_, {}, start); }, true);
    std::unique_ptr<Tracker> tracker;
    Found out;
    feed(
        0.1, kFlight_s, packet_ms,
        [&](const ImuSample& s) { tracker ? tracker->add_imu(s) : recovery.add_imu(s); },
        [&](const EventPacket& p) {
          if (tracker) return tracker->add_events(p);
          recovery.add_events(p);
          tracker = recovery.take();
          if (!tracker) return;
          out.at_s = flight_time(p.time(p.events.back()));
          tracker->on_update([&](const Update& u) { out.updates.push_back(u); });
        });
    return out;
  }
};

TEST_F(RecoveryLaws, PosesThatExplainTheEventsAlikeAreNamedOnce) {
  setup_.map = std::make_shared<const ContourMap>(test_flight::with_twins(*world_, {0, -0.25, 0}));
  TrackerStart start = start_off(0.1);
  start.searches = true;
  Recovery recovery([&] { return make_tracker(setup_, {}, start); }, true);
  std::vector<std::string> named;
  feed(
      0.1, 0.5, 2, [&](const ImuSample& s) { recovery.add_imu(s); },
      [&](const EventPacket& p) {
        recovery.add_events(p);
        if (std::string poses = recovery.take_ambiguous(); !poses.empty()) named.push_back(poses);
      });
  ASSERT_EQ(named.size(), 1U);
  EXPECT_TRUE(named.front().starts_with("2 poses explain the events alike: (")) << named.front();
  EXPECT_EQ(recovery.take(), nullptr);
}

TEST_F(RecoveryOfPackets, TakesOverWhereTheDataAreAndTracksOnTheSameEachTime) {
  const Found found = find(2), other = find(2);
  ASSERT_GT(found.at_s, 0);
  EXPECT_LT(found.at_s, 0.8);
  ASSERT_FALSE(found.updates.empty());
  EXPECT_LT(flight_time(found.updates.front().t), found.at_s + 0.01) << "it has caught up";
  for (const Update& u : found.updates) {
    EXPECT_EQ(u.health, Health::tracking) << u.reason;
    EXPECT_LT(error_m(u), 0.01);
  }
  ASSERT_EQ(found.updates.size(), other.updates.size());
  for (std::size_t i = 0; i < found.updates.size(); ++i) {
    EXPECT_EQ(found.updates[i].T_map_body.p, other.updates[i].T_map_body.p);
    EXPECT_EQ(found.updates[i].covariance, other.updates[i].covariance);
  }
}

TEST_F(RecoveryOfPackets, CatchesUpWithAStreamThatDoesNotWait) {
  TrackerStart start = start_off(0.1);
  start.searches = true;
  std::promise<void> made;
  Recovery recovery(
      [&] {
        auto tracker = make_tracker(setup_, {}, start);
        made.set_value();
        return tracker;
      },
      false);
  made.get_future().wait();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // from then on events are taken
  feed(
      0.1, kFlight_s, 2, [&](const ImuSample& s) { recovery.add_imu(s); },
      [&](const EventPacket& p) { recovery.add_events(p); });
  std::unique_ptr<Tracker> tracker;
  for (int i = 0; i < 6000 && !tracker; ++i) {  // however busy this machine is
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    tracker = recovery.take();
  }
  ASSERT_TRUE(tracker);
  const FusionState& state = tracker->state();
  EXPECT_NEAR(flight_time(state.t), kFlight_s, 0.02);
  EXPECT_LT((state.nav.T_map_body.p - pose_at(flight_time(state.t)).p).norm(), 0.01);
}

TEST_F(RecoveryOfPackets, FindsNothingInAnotherMap) {
  setup_.map = other_;
  EXPECT_LT(find(2).at_s, 0);
}

EventPacket packet_of(TimeNs base, int count) {
  EventPacket out;
  out.base = base;
  for (int i = 0; i < count; ++i) out.events.push_back(make_event(0, i % 320, 0, true));
  return out;
}

TEST(EvenShare, TakesAllThatIsWanted) {
  EvenShare share(6);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(share.of(packet_of(i * kNsPerMs, 5900)).events.size(), 5900u) << i;
}

TEST(EvenShare, OfMoreTakesAsManyAsAreWantedFromAllOfThePacket) {
  EvenShare share(6);
  std::size_t taken = 0;
  for (int i = 0; i < 1000; ++i) {
    const EventPacket out = share.of(packet_of(kNsPerS + i * kNsPerMs, 100'000));
    if (i < 100) continue;  // a burst may come at first
    taken += out.events.size();
    EXPECT_GT(out.events.size(), 4000u) << "none goes without";
  }
  EXPECT_NEAR(static_cast<double>(taken), 0.9 * 6e6, 0.01e6);
}

TEST_F(RecoveryLaws, WhatCannotBeMadeHasFailed) {
  TrackerStart start;
  start.state.T_map_body.p.x() = 1e6;
  Recovery recovery([&] { return make_tracker(setup_, {}, start); }, true);
  EXPECT_TRUE(recovery.failed());
  EXPECT_EQ(recovery.take(), nullptr);
}

/// What a session says of a flight.
class SessionSearches : public RecoveryLaws {
 protected:
  Session session(const TrackerStart& start) {
    SessionConfig config;
    config.waits = true;
    return {config,
            true,
            start,
            std::nullopt,
            [this](const TrackerStart& s) { return make_tracker(setup_, {}, s); },
            {[this](const Update& u, TimeNs, Tracker&) { updates_.push_back(u); },
             [this](const std::string& why) { restarts_.push_back(why); }, [](const std::string&) {},
             [](const std::string&) {}}};
  }
  static void feed_session(Session& session, double from_s, double to_s, bool events = true) {
    feed(
        from_s, to_s, 2,
        [&](const ImuSample& s) {
          StreamItem item;
          item.kind = StreamItem::Kind::imu;
          item.imu = {s};
          session.take(item, s.t);
        },
        [&](EventPacket p) {
          StreamItem item;
          item.kind = StreamItem::Kind::events;
          item.events = std::move(p);
          if (events) session.take(item, time(to_s));
        });
  }
  double wrong_m() const {
    double out = 0;
    for (const Update& u : updates_)
      if (u.health == Health::tracking) out = std::max(out, error_m(u));
    return out;
  }

  std::vector<Update> updates_;
  std::vector<std::string> restarts_;
};

TEST_F(SessionSearches, AnUnsureStartIsSearchedBeforeThereIsAPose) {
  Session s = session(start_off(0.1));
  feed_session(s, 0.1, 0.8);
  EXPECT_EQ(s.counts().searches, 1u);
  EXPECT_EQ(s.counts().found, 1u);
  ASSERT_FALSE(updates_.empty());
  EXPECT_EQ(updates_.back().health, Health::tracking);
  EXPECT_LT(wrong_m(), 0.01);
}

TEST_F(SessionSearches, ASureStartIsNotSearched) {
  Session s = session({{time(0.1), pose_at(0.1), test_flight::velocity_at(0.1)}});
  feed_session(s, 0.1, 0.5);
  EXPECT_EQ(s.counts().searches, 0u);
  EXPECT_LT(wrong_m(), 0.01);
}

TEST_F(SessionSearches, AStartThatIsWrongBeyondItsSigmaIsFoundByItself) {
  Session s = session({{time(0.1), pose_at(0.1).plus(kOff)}});
  feed_session(s, 0.1, kFlight_s);
  EXPECT_GE(s.counts().searches, 1u);
  EXPECT_EQ(s.counts().found, 1u);
  EXPECT_EQ(restarts_, std::vector<std::string>{"the pose was found"});
  EXPECT_EQ(updates_.back().health, Health::tracking);
  EXPECT_LT(wrong_m(), 0.01);
}

TEST_F(SessionSearches, AWrongMapIsSearchedEverMoreWidelyAndNeverTracked) {
  setup_.map = other_;
  Session s = session({{time(0.1), pose_at(0.1), test_flight::velocity_at(0.1)}});
  feed_session(s, 0.1, kFlight_s);
  EXPECT_GE(s.counts().searches, 1u);
  EXPECT_EQ(s.counts().found, 0u);
  EXPECT_NE(updates_.back().health, Health::tracking);
}

TEST_F(SessionSearches, AfterDataWereAwayThePoseIsFoundWhereItHasMovedTo) {
  Session s = session({{time(0.1), pose_at(0.1), test_flight::velocity_at(0.1)}});
  feed_session(s, 0.1, 0.4);
  feed_session(s, 0.9, kFlight_s);
  EXPECT_EQ(s.counts().restarts, 1u);
  EXPECT_EQ(updates_.back().health, Health::tracking);
  EXPECT_LT(error_m(updates_.back()), 0.01);
  EXPECT_LT(wrong_m(), 0.01);
}

}  // namespace
}  // namespace evpose
