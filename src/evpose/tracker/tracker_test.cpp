// SPDX-License-Identifier: BSD-3-Clause
// The whole tracker in a world of boxes of glass, whose edges make exact events: what it says when the input
// is bad.
#include "evpose/tracker/tracker.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <numbers>
#include <optional>
#include <random>

#include "evpose/core/config.h"
#include "evpose/tracker/test_flight.h"

namespace {
std::atomic<std::int64_t> allocations{0};
}  // namespace

// NOLINTBEGIN(cppcoreguidelines-no-malloc,misc-new-delete-overloads): this is what they are counted with.
namespace {
void* counted(std::size_t alignment, std::size_t size) {
  ++allocations;
  if (void* p = std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)) return p;
  throw std::bad_alloc();
}
}  // namespace
void* operator new(std::size_t size) { return counted(alignof(std::max_align_t), size); }
void* operator new(std::size_t size, std::align_val_t a) {
  return counted(static_cast<std::size_t>(a), size);
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
// NOLINTEND(cppcoreguidelines-no-malloc,misc-new-delete-overloads)

namespace evpose {
namespace {

using test_flight::add_edge;
using test_flight::boxes;
using test_flight::camera_on_body;
using test_flight::kStart_ns;
using test_flight::pose_at;

/// Some parallel lines far longer than the view.
ContourMap parallel_lines() {
  ContourMap map;
  for (int i = 0; i < 6; ++i)
    add_edge(map, {3 + 0.4 * i, -4, 0.6 + 0.3 * i}, {3 + 0.4 * i, 10, 0.6 + 0.3 * i});
  return map;
}

class BadInput : public ::testing::Test {
 protected:
  BadInput() {
    setup_.camera = test_flight::make_flight_camera();
    setup_.T_body_cam = camera_on_body();
    setup_.imu_noise.rate_hz = 1000;
  }

  /// Tracks what a camera sees of `world` with the map and camera of setup_ for so long; no events within the
  /// silence.
  void fly(const ContourMap& world, double seconds, double silent_from = 1e9, double silent_to = 1e9) {
    const Camera& camera = *setup_.camera;
    StartState start;
    start.t = kStart_ns;
    start.T_map_body = pose_at(0);
    start.velocity = test_flight::velocity_at(0);
    tracker_ = std::move(Tracker::create(setup_, config_, start)).value();
    tracker_->on_update([this](const Update& u) {
      updates_.push_back(u);
      if (!u.reason.empty()) reasons_.push_back(std::string(to_string(u.health)) + ": " + u.reason);
    });
    updates_.reserve(10000);
    constexpr int kStepsPerPacket = 4;
    constexpr double kStep_s = test_flight::EdgeEvents::kStep_s;
    test_flight::EdgeEvents edges(world, camera), later(later_world_ ? *later_world_ : world, camera);
    std::vector<test_flight::TimedEvent> events;
    for (int i = 0; kStep_s * i < seconds; ++i) {
      const double t = kStep_s * i;
      (t < changes_s_ ? edges : later).advance(t, t >= silent_from && t < silent_to, events);
      if ((i + 1) % kStepsPerPacket != 0) continue;
      if (t < imu_ends_s_) tracker_->add_imu(test_flight::imu_at(t));
      const EventPacket packet = test_flight::make_packet(events, t - kStepsPerPacket * kStep_s);
      events.clear();
      const std::int64_t already = allocations;
      const std::size_t done = updates_.size();
      if (!packet.empty()) tracker_->add_events(packet);
      tracker_->events_complete_until(kStart_ns + from_seconds(t));
      if (updates_.size() == done + 1) allocated_.push_back(allocations - already);
    }
  }

  static double error_m(const Update& u) {
    return (u.T_map_body.p - pose_at(to_seconds(u.t - kStart_ns)).p).norm();
  }
  static double sigma_m(const Update& u) { return std::sqrt(u.covariance.topLeftCorner<3, 3>().trace()); }
  const Update& at(double t) const {
    return updates_[std::min(updates_.size() - 1, static_cast<std::size_t>(t * config_.rate_hz))];
  }
  bool said(const std::string& words) const {
    return std::any_of(reasons_.begin(), reasons_.end(),
                       [&](const std::string& r) { return r.find(words) != std::string::npos; });
  }
  std::string all_reasons() const {
    std::string out;
    for (const auto& r : reasons_) out += r + "\n";
    return out;
  }

  TrackerSetup setup_;
  TrackerConfig config_;
  double imu_ends_s_ = 1e9;
  std::optional<ContourMap> later_world_;  ///< what there is from changes_s_ on
  double changes_s_ = 1e9;
  std::unique_ptr<Tracker> tracker_;
  std::vector<Update> updates_;
  std::vector<std::string> reasons_;
  std::vector<std::int64_t> allocated_;  ///< per update
};

TEST(TrackerConfig, HasNoMoreThanFiftySettings) {
  TrackerConfig config;
  ConfigTable table;
  describe(table, config);
  EXPECT_LE(table.values().size(), 50U);
}

TEST_F(BadInput, GoodInputIsTrackedAndAllocatesNextToNothing) {
  setup_.map = std::make_shared<const ContourMap>(boxes());
  fly(*setup_.map, 1.2);
  EXPECT_EQ(updates_.back().health, Health::tracking) << all_reasons();
  for (const double t : {0.4, 0.8, 1.1}) {
    EXPECT_LT(error_m(at(t)), 4e-3) << t;
    EXPECT_LT(error_m(at(t)), 4 * sigma_m(at(t))) << t;
  }
  // Nothing but a block of a queue now and then (deque), and what a larger choice of points needs.
  std::int64_t sum = 0;
  for (std::size_t i = allocated_.size() / 2; i < allocated_.size(); ++i) sum += allocated_[i];
  EXPECT_LE(sum, static_cast<std::int64_t>(allocated_.size() / 4));
}

TEST_F(BadInput, SilenceOfTheEventsIsNamedAndTheCovarianceGrows) {
  setup_.map = std::make_shared<const ContourMap>(boxes());
  fly(*setup_.map, 2.6, 0.6, 2.4);
  EXPECT_EQ(at(0.55).health, Health::tracking);
  EXPECT_NE(at(0.8).health, Health::tracking);
  EXPECT_TRUE(said("map points have events near by")) << all_reasons();
  EXPECT_GT(sigma_m(at(1.2)), 2 * sigma_m(at(0.7)));
  EXPECT_GT(sigma_m(at(2.3)), 2 * sigma_m(at(1.2)));
  EXPECT_LT(error_m(at(2.3)), 4 * sigma_m(at(2.3)));
}

TEST_F(BadInput, AnImuThatEndsIsNamedAndUpdatesGoOn) {
  setup_.map = std::make_shared<const ContourMap>(boxes());
  imu_ends_s_ = 0.5;
  fly(*setup_.map, 1.0);
  EXPECT_GT(to_seconds(updates_.back().t - kStart_ns), 0.9);
  EXPECT_TRUE(said("no IMU samples")) << all_reasons();
  EXPECT_NE(updates_.back().health, Health::tracking);
  EXPECT_LT(error_m(updates_.back()), 4 * sigma_m(updates_.back()));
}

TEST_F(BadInput, NoVisiblePointIsNamed) {
  ContourMap behind = boxes();
  for (ContourPoint& p : behind.points) p.position.x() = -p.position.x();
  setup_.map = std::make_shared<const ContourMap>(behind);
  fly(boxes(), 1.0);
  EXPECT_NE(updates_.back().health, Health::tracking);
  EXPECT_EQ(updates_.back().points, 0);
  EXPECT_GT(sigma_m(at(0.9)), 2 * sigma_m(at(0.3)));
}

TEST_F(BadInput, ParallelLinesLeaveTheirDirectionOpen) {
  setup_.map = std::make_shared<const ContourMap>(parallel_lines());
  fly(*setup_.map, 2.0);
  const Matrix6d c = updates_.back().covariance;
  EXPECT_GT(c(1, 1), 10 * c(0, 0));
  EXPECT_GT(c(1, 1), 10 * c(2, 2));
  EXPECT_NE(updates_.back().health, Health::tracking);
  EXPECT_TRUE(said("pose uncertain by")) << all_reasons();
  EXPECT_LT(error_m(updates_.back()), 5 * sigma_m(updates_.back()));
}

// So few and clean edges can follow the wrong ones for a while; the pose is not called a good one.
TEST_F(BadInput, AMirroredMapIsNoticed) {
  constexpr unsigned kPlaces = 12;
  int noticed = 0;
  for (unsigned seed = 1; seed <= kPlaces; ++seed) {
    ContourMap mirrored = boxes(seed);
    for (ContourPoint& p : mirrored.points) p.position.y() = 6 - p.position.y();
    setup_.map = std::make_shared<const ContourMap>(mirrored);
    updates_.clear();
    reasons_.clear();
    fly(boxes(seed), 1.0);
    noticed += said("not in this map") ? 1 : 0;
    for (const Update& u : updates_)
      EXPECT_TRUE(u.health != Health::tracking || error_m(u) < 5 * sigma_m(u)) << seed;
  }
  EXPECT_GE(noticed, static_cast<int>(kPlaces) - 3);  // boxes in a row are nearly the same mirrored
}

// As if the pose had slid along the edges that it sees best.
TEST_F(BadInput, APoseThatWasConfirmedIsDoubtedWhereOneDirectionStaysWithoutEvents) {
  setup_.map = std::make_shared<const ContourMap>(boxes());
  later_world_ = boxes();
  changes_s_ = 0.6;
  for (ContourPoint& p : later_world_->points)
    if (std::abs(p.tangent.y()) < 0.9F) p.position.y() -= 0.13F;
  fly(*setup_.map, 2.0);
  EXPECT_EQ(at(0.55).health, Health::tracking);
  double doubted_sigma_m = 0;
  for (const Update& u : updates_)
    if (u.health == Health::degraded) doubted_sigma_m = std::max(doubted_sigma_m, sigma_m(u));
  EXPECT_TRUE(said("degraded: not in this map, or far from the pose: contours of one direction lie"))
      << all_reasons();
  EXPECT_GT(doubted_sigma_m, 0.1);
}

TEST_F(BadInput, TheMapOfAnotherPlaceEndsLostAndIsNeverCalledTracking) {
  config_.relocalization.on = false;
  for (const unsigned seed : {4U, 5U}) {
    setup_.map = std::make_shared<const ContourMap>(boxes(seed));
    updates_.clear();
    reasons_.clear();
    fly(boxes(), 1.5);
    for (const Update& u : updates_) EXPECT_NE(u.health, Health::tracking) << seed << all_reasons();
    EXPECT_EQ(updates_.back().health, Health::lost) << seed << all_reasons();
    EXPECT_TRUE(said("lost: not in this map")) << seed << all_reasons();
    EXPECT_LT(error_m(at(0.5)), 3 * sigma_m(at(0.5))) << seed;
  }
}

// As in a map built from a cloud: each contour stands off by some millimetres, and says so.
TEST_F(BadInput, WhereContoursStandOffIsLearntFromTheirEvents) {
  ContourMap map = boxes();
  std::mt19937 random(5);
  std::normal_distribution<float> off(0, 4e-3F);
  Eigen::Vector3f shift = Eigen::Vector3f::Zero();
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    ContourPoint& p = map.points[i];
    if (i == 0 || map.points[i - 1].contour != p.contour)
      shift = off(random) * p.normal + off(random) * p.normal.cross(p.tangent);
    p.position += shift;
    p.sigma = 4e-3F;
  }
  setup_.map = std::make_shared<const ContourMap>(map);
  config_.fusion.segments.length_m = 5;  // each contour is off by one and the same along its length
  const auto mean_error_m = [&](SegmentOffsetUse use) {
    config_.fusion.segment_offsets = use;
    updates_.clear();
    fly(boxes(), 2.0);
    double sum = 0;
    int count = 0;
    for (const Update& u : updates_)
      if (to_seconds(u.t - kStart_ns) > 0.2) sum += error_m(u), ++count;
    return sum / count;
  };
  const double learnt = mean_error_m(SegmentOffsetUse::automatic),
               plain = mean_error_m(SegmentOffsetUse::off);
  EXPECT_LT(learnt, 0.6 * plain) << plain;
}

ContourMap joined(ContourMap map, std::initializer_list<unsigned> seeds) {
  for (const unsigned seed : seeds)
    for (ContourPoint p : boxes(seed).points) {
      p.contour += 1000 * seed;
      map.points.push_back(p);
    }
  return map;
}

/// The world has as many edges that the map lacks as the map has contours that are none, which contradicts
/// the pose; but at what both have events gather. So it is kept for a second more.
TEST_F(BadInput, APoseThatWasGivenIsNotLeftWhereAMapThatStatesErrorsHasContoursThatAreNone) {
  ContourMap map = joined(boxes(), {20, 21, 22, 23, 24, 25, 26, 27});
  for (ContourPoint& p : map.points) p.sigma = 0.004F;
  setup_.map = std::make_shared<ContourMap>(map);
  config_.relocalization.on = true;
  fly(joined(boxes(), {40, 41, 42, 43}), 1.0);
  EXPECT_TRUE(said("not in this map")) << all_reasons();
  for (const Update& u : updates_) {
    EXPECT_NE(u.health, Health::lost) << to_seconds(u.t) << all_reasons();
    EXPECT_LT(error_m(u), 4 * sigma_m(u)) << to_seconds(u.t);
  }
}

}  // namespace
}  // namespace evpose
