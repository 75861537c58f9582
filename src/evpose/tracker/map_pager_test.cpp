// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/map_pager.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "evpose/map/visible_set.h"
#include "evpose/registration/rearranged.h"
#include "evpose/tracker/test_flight.h"
#include "evpose/tracker/tracker.h"

namespace evpose {
namespace {

using test_flight::kStart_ns;

/// Of a map, the points from `first` on and before `end`.
std::shared_ptr<const ContourMap> part_of(const ContourMap& whole, std::uint32_t first, std::uint32_t end) {
  auto part = std::make_shared<ContourMap>();
  for (std::uint32_t i = first; i < end; ++i) {
    part->points.push_back(whole.points[i]);
    part->numbers.push_back(i);
  }
  return part;
}

/// The boxes between a post that is never seen and another one; `begin` and `end` of the boxes' points.
ContourMap between_posts(std::uint32_t* begin, std::uint32_t* end) {
  ContourMap map;
  test_flight::add_edge(map, {-90, 0, 0}, {-90, 0, 9});
  *begin = static_cast<std::uint32_t>(map.points.size());
  const std::int32_t first = map.points.back().contour + 1;
  for (ContourPoint p : test_flight::boxes().points) {
    p.contour += first;
    p.contrast = static_cast<std::int8_t>(p.contour % 3 - 1);
    map.points.push_back(p);
  }
  *end = static_cast<std::uint32_t>(map.points.size());
  test_flight::add_edge(map, {90, 0, 0}, {90, 0, 9});
  return map;
}

TEST(MapPager, PointsAndSegmentsOfTwoPartsAreJoinedByTheirPlace) {
  std::uint32_t begin = 0, end = 0;
  const ContourMap whole = between_posts(&begin, &end);
  const auto all = static_cast<std::uint32_t>(whole.points.size());
  const PreparedMap before(part_of(whole, 0, end - 100), 0.6);
  const NextMap next = followed(before, {part_of(whole, begin, all), 0.6});
  const ContourMap &old = *before.map, &now = *next.prepared.map;
  for (std::uint32_t i = 0; i < old.points.size(); ++i) {
    const std::uint32_t j = next.point_now[i];
    if (i < begin) {
      EXPECT_EQ(j, VisibleSet::kGone);
      continue;
    }
    ASSERT_LT(j, now.points.size());
    EXPECT_EQ(now.points[j].position, old.points[i].position);
    EXPECT_EQ(next.segment_before[next.prepared.segments.of_point[j]], before.segments.of_point[i]);
    EXPECT_EQ(next.prepared.offset_segments[j], before.offset_segments[i]);
  }
  const auto fresh = std::count(next.segment_before.begin(), next.segment_before.end(), kNewSegment);
  std::set<std::uint32_t> in_new_points;
  for (std::uint32_t j = end - 100 - begin; j < now.points.size(); ++j)
    in_new_points.insert(next.prepared.segments.of_point[j]);
  EXPECT_GT(fresh, 0);
  EXPECT_LE(static_cast<std::size_t>(fresh), in_new_points.size());
}

TEST(MapPager, PlacesAloneDecideWhenAPartIsAskedForAndTaken) {
  std::uint32_t begin = 0, end = 0;
  const ContourMap whole = between_posts(&begin, &end);
  PreparedMap held(part_of(whole, begin, end), 0);
  std::vector<double> asked_x;
  const auto parts = [&](const Eigen::Vector3d& place, double radius_m) {
    asked_x.push_back(place.x());
    EXPECT_EQ(radius_m, 40 + MapPager::kMargin_m);
    return part_of(whole, begin, end);
  };
  std::vector<int> taken_x;
  {
    MapPager pager(parts, Eigen::Vector3d::Zero(), 40, 0);
    for (int x = 0; x <= 100; ++x) {
      const bool may_take = x != 41;
      if (auto next = pager.next({static_cast<double>(x), 0, 500}, held, may_take)) {
        taken_x.push_back(x);
        held = std::move(next->prepared);
      }
    }
  }                                                // what is under way ends
  EXPECT_EQ(taken_x, (std::vector<int>{42, 72}));  // 41 was refused
  EXPECT_EQ(asked_x, (std::vector<double>{31, 62, 93}));
}

TEST(MapPager, WhatCannotBeReadLeavesThePartInUse) {
  std::uint32_t begin = 0, end = 0;
  const ContourMap whole = between_posts(&begin, &end);
  const PreparedMap held(part_of(whole, begin, end), 0);
  int asked = 0;
  {
    MapPager pager([&](const Eigen::Vector3d&, double) { return ++asked, nullptr; }, Eigen::Vector3d::Zero(),
                   40, 0);
    for (int x = 0; x <= 100; ++x) EXPECT_EQ(pager.next({static_cast<double>(x), 0, 0}, held, true), nullptr);
  }  // what is under way ends
  EXPECT_EQ(asked, 3);
}

struct Flight {
  std::vector<Update> updates;
  int parts = 0;
};

/// Tracks the boxes with a map whose middle is so far away that the later part is taken in the midst of the
/// flight.
Flight fly(const ContourMap& whole, std::shared_ptr<const ContourMap> first,
           const std::shared_ptr<const ContourMap>& later, bool offsets) {
  Flight out;
  TrackerSetup setup;
  setup.camera = test_flight::make_flight_camera();
  setup.T_body_cam = test_flight::camera_on_body();
  setup.imu_noise.rate_hz = 1000;
  setup.map = std::move(first);
  if (later != nullptr) {
    setup.map_parts = [&out, later](const Eigen::Vector3d&, double) { return ++out.parts, later; };
    setup.map_middle = {0.9 - MapPager::kTake_m, 3.2, 0};  // the flight comes by 0.9 m after 0.28 s
  }
  TrackerConfig config;
  config.fusion.segment_offsets = offsets ? SegmentOffsetUse::on : SegmentOffsetUse::off;
  StartState start;
  start.t = kStart_ns;
  start.T_map_body = test_flight::pose_at(0);
  start.velocity = test_flight::velocity_at(0);
  auto tracker = std::move(Tracker::create(setup, config, start)).value();
  tracker->on_update([&](const Update& u) { out.updates.push_back(u); });
  test_flight::EdgeEvents events(whole, *setup.camera);
  std::vector<test_flight::TimedEvent> batch;
  for (int step = 1; step <= 2400; ++step) {
    const double t_s = step * test_flight::EdgeEvents::kStep_s;
    events.advance(t_s, false, batch);
    if (step % 4 != 0) continue;
    tracker->add_imu(test_flight::imu_at(t_s));
    if (!batch.empty())
      tracker->add_events(test_flight::make_packet(batch, t_s - 4 * test_flight::EdgeEvents::kStep_s));
    batch.clear();
  }
  return out;
}

TEST(MapPager, APartOfTheMapTracksAsTheWholeDoesAcrossHandOver) {
  std::uint32_t begin = 0, end = 0;
  const ContourMap whole = between_posts(&begin, &end);
  const auto all = static_cast<std::uint32_t>(whole.points.size());
  for (const bool offsets : {false, true}) {
    const Flight by_whole = fly(whole, part_of(whole, 0, all), nullptr, offsets);
    const Flight by_parts = fly(whole, part_of(whole, 0, end), part_of(whole, begin, all), offsets);
    EXPECT_EQ(by_parts.parts, 1);
    ASSERT_GT(by_whole.updates.size(), 150U);
    ASSERT_EQ(by_whole.updates.size(), by_parts.updates.size());
    EXPECT_EQ(by_whole.updates.back().health, Health::tracking);
    for (std::size_t k = 0; k < by_whole.updates.size(); ++k) {
      const Update &a = by_whole.updates[k], &b = by_parts.updates[k];
      ASSERT_EQ(a.T_map_body.p, b.T_map_body.p) << k;
      ASSERT_EQ(a.T_map_body.q.coeffs(), b.T_map_body.q.coeffs()) << k;
    }
  }
}

}  // namespace
}  // namespace evpose
