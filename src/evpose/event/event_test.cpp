// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "evpose/event/event_preprocessor.h"

namespace evpose {
namespace {

EventPacket packet(TimeNs base, std::initializer_list<Event> events) { return {base, events}; }

std::vector<std::uint32_t> contents(const EventPreprocessor& front) {
  std::vector<std::uint32_t> out;
  for (int y = 0; y < front.surface()->height(); ++y)
    for (int x = 0; x < front.surface()->width(); ++x)
      for (Polarity p : {Polarity::off, Polarity::on}) out.push_back(front.surface()->last(x, y, p));
  return out;
}

EventPacket random_events(int n, unsigned width, unsigned height, unsigned step_us) {
  std::mt19937 random(3);
  EventPacket p;
  std::uint32_t t = 0;
  for (int i = 0; i < n; ++i) {
    t += static_cast<std::uint32_t>(random() % (2 * step_us));
    const int x = static_cast<int>(random() % width), y = static_cast<int>(random() % height);
    p.events.push_back(make_event(t, x, y, random() % 2 == 1));
  }
  return p;
}

TEST(NoiseFilter, KeepsAnEventOnlyWithARecentNeighbour) {
  EventPreprocessorConfig config;
  config.noise.support_min_s = config.noise.support_max_s = 5e-3;
  EventPreprocessor front(20, 20, config);
  front.keep_surface(true);
  const auto p = packet(kNsPerS, {{0, 5, 5, 1},        // first of all: no support
                                  {5000, 6, 6, 0},     // neighbour 5 ms ago: kept
                                  {5001, 5, 5, 1},     // its own pixel does not count, but (6, 6) does
                                  {9000, 15, 15, 1},   // far from everything
                                  {20000, 6, 5, 1}});  // neighbours too old
  front.take(p, p.events);
  EXPECT_EQ(front.counts().read, 5);
  EXPECT_EQ(front.counts().kept, 2);
  EXPECT_NE(front.surface()->last(6, 6, Polarity::off), 0u);
  EXPECT_NE(front.surface()->last(5, 5, Polarity::on), 0u);
  EXPECT_EQ(front.surface()->last(15, 15, Polarity::on), 0u);
}

TEST(NoiseFilter, WindowIsALengthInTheImage) {
  NoiseFilterConfig config;
  config.support_px = 1;
  config.support_min_s = 1e-3;
  config.support_max_s = 1;
  NoiseFilter filter(10, 10, config);
  filter.set_motion(100);  // 1 px takes 10 ms
  filter.keep(4, 4, 1000);
  EXPECT_TRUE(filter.keep(5, 4, 11000));
  EXPECT_FALSE(filter.keep(6, 4, 22000));
}

TEST(NoiseFilter, MasksThePixelThatFiresAlone) {
  NoiseFilter filter(32, 32, {});
  std::uint32_t t = 1;
  for (int i = 0; i < 1400; ++i) {  // two seconds: a band of rows counts for one, and the first turn is short
    t += 1500;
    filter.keep(20, 20, t);                            // 667 Hz, alone
    if (i % 100 == 0) filter.keep(1 + i / 100, 5, t);  // a slow edge
  }
  ASSERT_EQ(filter.hot_pixels().size(), 1u);
  EXPECT_EQ(filter.hot_pixels()[0].x, 20);
  EXPECT_EQ(filter.hot_pixels()[0].y, 20);
  EXPECT_FALSE(filter.keep(20, 20, t + 1));
  EXPECT_FALSE(filter.keep(21, 20, t + 2)) << "a hot pixel supports nobody";
}

/// One that stops and goes on after a long time is not taken for it; nor are others than the one, wherever.
TEST(NoiseFilter, MasksPixelsInEveryBandAndNoneThatRested) {
  NoiseFilter filter(40, 200, {});
  std::uint32_t t = 1;
  for (int i = 0; i < 2100; ++i) {
    t += 1000;
    for (int y = 3; y < 200; y += 24) filter.keep(20, y, t);
    filter.keep(i % 15, i % 200, t);  // what else moves
  }
  ASSERT_EQ(filter.hot_pixels().size(), 9u);
  NoiseFilter rested(40, 200, {});
  t = 1;
  for (int i = 0; i < 200; ++i) rested.keep(20, 100, t += 500'000);  // two a second
  EXPECT_TRUE(rested.hot_pixels().empty());
}

TEST(TimeSurface, KeepsTheLastEventOfEachPolarity) {
  TimeSurface s(4, 4);
  s.insert(1, 2, Polarity::on, 100);
  s.insert(1, 2, Polarity::on, 900);
  EXPECT_EQ(s.last(1, 2, Polarity::on), 900u);
  EXPECT_EQ(s.last(1, 2, Polarity::off), 0u);
  s.insert(1, 2, Polarity::off, 2000);
  EXPECT_EQ(s.last(1, 2, Polarity::on), 900u);
  EXPECT_EQ(s.last(1, 2, Polarity::off), 2000u);
}

TEST(EventPreprocessor, TheSurfaceHoldsWhatWasKeptSinceItWasAskedFor) {
  EventPreprocessor front(20, 20, {});
  const auto first = packet(0, {{10, 5, 5, 1}, {11, 6, 5, 1}}), second = packet(0, {{20, 5, 6, 1}});
  front.take(first, first.events);
  EXPECT_EQ(front.surface(), nullptr);
  front.keep_surface(true);
  front.take(second, second.events);
  EXPECT_EQ(front.surface()->last(6, 5, Polarity::on), 0u);
  EXPECT_NE(front.surface()->last(5, 6, Polarity::on), 0u);
  front.keep_surface(false);
  EXPECT_EQ(front.surface(), nullptr);
}

TEST(EventPreprocessor, IsTheSameHoweverThePacketsAreCut) {
  const EventPacket all = random_events(20000, 40, 30, 30);
  EventPreprocessor whole(40, 30, {}), cut(40, 30, {});
  whole.keep_surface(true);
  cut.keep_surface(true);
  whole.take(all, all.events);
  const std::span<const Event> events(all.events);
  for (std::size_t i = 0; i < events.size(); i += 137) {
    // Each piece with a base of its own, as a reader would make it.
    EventPacket piece;
    piece.base = all.time(events[i]);
    for (const Event& e : events.subspan(i, std::min<std::size_t>(137, events.size() - i)))
      piece.events.push_back(make_event(e.dt_us - events[i].dt_us, e.x, e.y, e.on != 0));
    cut.take(piece, piece.events);
  }
  EXPECT_EQ(whole.counts().kept, cut.counts().kept);
  EXPECT_EQ(contents(whole), contents(cut));
}

TEST(InterestMap, HoldsTheCellsThatAreMarked) {
  for (const auto& [width, height] : {std::pair{13, 9}, {300, 40}, {1280, 720}}) {
    std::mt19937 random(2);
    InterestMap map(width, height);
    std::vector<bool> cells(static_cast<std::size_t>(map.columns() * map.rows()));
    for (int i = 0; i < 12; ++i) {
      const int row = static_cast<int>(random() % static_cast<unsigned>(map.rows()));
      int first = static_cast<int>(random() % static_cast<unsigned>(map.columns())), last = first;
      last += static_cast<int>(random() % static_cast<unsigned>(map.columns() - first));
      map.mark(row, first, last);
      for (int c = first; c <= last; ++c) cells[static_cast<std::size_t>(row * map.columns() + c)] = true;
    }
    std::size_t marked = 0;
    for (int y = 0; y < height + 3; ++y)
      for (int x = 0; x < width + 3; ++x) {
        const int cell = y / InterestMap::kCell_px * map.columns() + x / InterestMap::kCell_px;
        const bool inside = x < width && y < height;
        ASSERT_EQ(map.holds(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y)),
                  inside && cells[static_cast<std::size_t>(cell)])
            << x << ' ' << y;
      }
    for (const bool cell : cells) marked += cell;
    EXPECT_NEAR(map.share(), static_cast<double>(marked) / static_cast<double>(cells.size()), 1e-12);
    map.clear();
    EXPECT_EQ(map.share(), 0);
  }
}

TEST(EventPreprocessor, HandsOnWhatMattersWhetherThereIsASurfaceOrNot) {
  const EventPacket all = random_events(20000, 43, 33, 30);  // some outside of the image
  InterestMap interest(40, 30);
  interest.mark(2, 3, 7);
  std::vector<std::vector<std::uint32_t>> taken;
  for (const bool surface : {false, true}) {
    EventPreprocessor front(40, 30, {});
    front.keep_surface(surface);
    front.set_interest(&interest);
    front.take(all, std::span(all.events).first(7001));
    front.take(all, std::span(all.events).subspan(7001));
    NoiseFilter filter(40, 30, {});
    std::vector<std::uint32_t> expected;
    std::int64_t outside = 0;
    for (const Event& e : all.events) {
      outside += e.x >= 40 || e.y >= 30;
      const std::uint32_t stamp = front.stamp(all.time(e));
      if (e.x >= 12 && e.x < 32 && e.y >= 8 && e.y < 12 && filter.keep(e.x, e.y, stamp))
        expected.push_back(stamp);
    }
    taken.emplace_back();
    for (const FilteredEvent& e : front.kept()) taken.back().push_back(e.stamp_us);
    EXPECT_EQ(taken.back(), expected);
    EXPECT_GT(expected.size(), 100U);
    EXPECT_EQ(front.counts().read, 20000);
    EXPECT_EQ(front.counts().outside, outside);
    EXPECT_EQ(front.counts().kept, static_cast<std::int64_t>(expected.size()));
    // Pictures show more than what is handed on.
    if (!surface) continue;
    const std::vector<std::uint32_t> drawn = contents(front);
    EXPECT_GT(drawn.size() - static_cast<std::size_t>(std::count(drawn.begin(), drawn.end(), 0U)), 500U);
  }
  EXPECT_EQ(taken[0], taken[1]);
}

TEST(EventPreprocessor, ClockSurvivesHoursOfData) {
  EventPreprocessor front(10, 10, {});
  front.keep_surface(true);
  TimeNs t = 1'700'000'000 * kNsPerS;
  for (int minute = 0; minute < 200; ++minute, t += 60 * kNsPerS) {
    const auto p = packet(t, {{0, 4, 4, 1}, {500, 5, 4, 1}});
    front.take(p, p.events);
    EXPECT_EQ(front.stamp(t + 500 * kNsPerUs), front.surface()->last(5, 4, Polarity::on)) << minute;
  }
  EXPECT_EQ(front.counts().kept, 200);
}

/// A burst of 40 Mev/s for 20 ms into a front that takes 4: a bounded number passes, from everywhere.
TEST(EventPreprocessor, ABurstIsShedEvenlyAndCounted) {
  constexpr int kSide = 64, kEvents = 800'000;
  EventPreprocessorConfig config;
  config.most_mev_s = 4;
  EventPreprocessor front(kSide, kSide, config);
  EventPacket burst;
  for (int i = 0; i < kEvents; ++i)
    burst.events.push_back(
        make_event(static_cast<std::uint32_t>(i / 40), i % kSide, i / kSide % kSide, true));
  front.take(burst, burst.events);
  const double passed = static_cast<double>(front.counts().read - front.counts().shed);
  EXPECT_EQ(front.counts().read, kEvents);
  EXPECT_GT(passed, 4 * 20000 * 0.9);
  EXPECT_LT(passed, 4 * (20000 + 5000) * 1.1);
  int upper = 0;
  for (const FilteredEvent& e : front.kept()) upper += e.y < kSide / 2;
  EXPECT_NEAR(upper, 0.5 * static_cast<double>(front.kept().size()), 0.02 * passed);
}

TEST(EventPreprocessor, BelowTheLimitNothingIsShed) {
  EventPreprocessorConfig config;
  config.most_mev_s = 1;
  EventPreprocessor front(40, 30, config);
  const EventPacket p = random_events(20000, 40, 30, 2);  // half a million events a second
  front.take(p, p.events);
  EXPECT_EQ(front.counts().shed, 0);
}

TEST(EventPreprocessor, EventsOutsideTheImageAreCountedAndLeftOut) {
  EventPreprocessor front(10, 10, {});
  const auto p = packet(0, {{0, 10, 4, 1}, {1, 4, 10, 1}, {2, 40000, 9, 1}});
  front.take(p, p.events);
  EXPECT_EQ(front.counts().outside, 3);
  EXPECT_EQ(front.counts().kept, 0);
}

}  // namespace
}  // namespace evpose
