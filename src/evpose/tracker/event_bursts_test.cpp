// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/event_bursts.h"

#include <gtest/gtest.h>

#include <random>

#include "evpose/tracker/event_intervals.h"

namespace evpose {
namespace {

constexpr std::uint32_t kLook_us = 3300, kEvery_us = 13'000, kPeriod_us = 8333;

/// Events of one look: so many a millisecond of what moves (x = 0), and of lamps that flicker (x = 1), in
/// three quarters of each period.
std::vector<FilteredEvent> look(std::uint32_t from_us, double moving_ms, double flicker_ms,
                                std::mt19937& random) {
  std::vector<FilteredEvent> out;
  for (std::uint32_t t = from_us; t < from_us + kLook_us; t += 10) {
    const auto add = [&](double per_ms, std::uint16_t x) {
      const int n = std::poisson_distribution<int>(0.01 * per_ms)(random);
      for (int i = 0; i < n; ++i) {
        FilteredEvent e{};
        e.stamp_us = t, e.x = x;
        // Lamps brighten and darken in turn.
        e.on = x == 0 ? random() % 2 : t / kPeriod_us % 2;
        out.push_back(e);
      }
    };
    if (moving_ms > 0) add(moving_ms, 0);
    if (flicker_ms > 0 && 4 * (t % kPeriod_us) > kPeriod_us) add(flicker_ms, 1);
  }
  return out;
}

struct Kept {
  double moving = 0, flicker = 0;  // share
};

Kept kept_of(double moving_ms, double flicker_ms) {
  std::mt19937 random(1);
  EventBursts bursts;
  double all[2] = {}, kept[2] = {};
  for (std::uint32_t k = 0; k < 100; ++k) {
    const auto events = look(k * kEvery_us, moving_ms, flicker_ms, random);
    const auto quiet = bursts.quiet(events);
    if (k < 8) continue;  // until the light is known
    for (const FilteredEvent& e : events) ++all[e.x];
    for (const FilteredEvent& e : quiet) ++kept[e.x];
  }
  return {kept[0] / all[0], kept[1] / std::max(1.0, all[1])};
}

TEST(EventBursts, LampsThatFlickerLeaveWhatMovesBetweenTheirBursts) {
  const Kept kept = kept_of(2000, 60'000);
  EXPECT_GT(kept.moving, 0.15);
  EXPECT_LT(kept.flicker, 0.02);
}

TEST(EventBursts, OfSteadyEventsAllAreKept) {
  for (const double moving_ms : {1.0, 50.0, 5000.0}) EXPECT_EQ(kept_of(moving_ms, 0).moving, 1) << moving_ms;
}

TEST(EventBursts, WhereMoreMovesNothingIsLeftOut) {
  std::mt19937 random(2);
  EventBursts bursts;
  for (std::uint32_t k = 0; k < 20; ++k) bursts.quiet(look(k * kEvery_us, 500, 0, random));
  double all = 0, kept = 0;
  for (std::uint32_t k = 20; k < 24; ++k) {
    const auto events = look(k * kEvery_us, 20'000, 0, random);
    all += static_cast<double>(events.size());
    kept += static_cast<double>(bursts.quiet(events).size());
  }
  EXPECT_EQ(kept, all);
}

// Below the limit nothing is left out; above it what is kept is as many as are allowed, and of bursts no more
// than their time's share.
TEST(EventIntervals, AreThinnedEvenlyInTime) {
  std::mt19937 random(3);
  const auto kept = [&](const std::vector<FilteredEvent>& events) {
    EventIntervals intervals(1);
    ImuIncrement motion;
    motion.dt_s = 1e-6 * kLook_us;
    intervals.add(events, kLook_us, motion, Eigen::Vector3d::Zero());
    return intervals[0].events;
  };
  const auto few = look(0, 200, 0, random);
  EXPECT_EQ(kept(few).size(), few.size());
  const double most = EventIntervals::kMostEvents_s * 1e-6 * kLook_us;
  EXPECT_NEAR(static_cast<double>(kept(look(0, 20'000, 0, random)).size()), most, 0.01 * most);
  const auto flickering = look(0, 500, 60'000, random);
  std::array<double, 2> all{}, left{};
  for (const FilteredEvent& e : flickering) ++all[e.x];
  for (const FilteredEvent& e : kept(flickering)) ++left[e.x];
  // A quarter of the time is without flicker.
  EXPECT_GT(left[0], 0.25 * all[0]);
  EXPECT_LT(left[1], 0.06 * all[1]);
}

}  // namespace
}  // namespace evpose
