// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/read_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <tuple>

#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

constexpr ImageSize kSize{320, 200};

// Events at random pixels, `spacing_ns` apart on average, sorted by (t, y, x).
std::vector<SimEvent> random_events(std::size_t count, double spacing_ns, std::uint64_t seed) {
  Random random(seed);
  std::vector<SimEvent> events(count);
  double t = 5e6;
  for (SimEvent& e : events) {
    t += spacing_ns * random.exponential();
    e.t = static_cast<TimeNs>(t);
    e.x = static_cast<std::uint16_t>(random.uniform(0, kSize.width));
    e.y = static_cast<std::uint16_t>(random.uniform(0, kSize.height));
    e.on = random.uniform() < 0.5;
  }
  const auto key = [](const SimEvent& e) { return std::tuple(e.t, e.y, e.x); };
  std::sort(events.begin(), events.end(),
            [&](const SimEvent& a, const SimEvent& b) { return key(a) < key(b); });
  return events;
}

std::vector<SimEvent> run(ReadOut& read_out, const std::vector<SimEvent>& events, TimeNs block) {
  std::vector<SimEvent> out;
  std::size_t begin = 0;
  for (TimeNs until = block; begin < events.size(); until += block) {
    std::size_t end = begin;
    while (end < events.size() && events[end].t <= until) ++end;
    read_out.push(std::span(events).subspan(begin, end - begin), until, out);
    begin = end;
  }
  read_out.finish(out);
  return out;
}

void expect_same(const std::vector<SimEvent>& a, const std::vector<SimEvent>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].t, b[i].t) << i;
    ASSERT_EQ(a[i].x, b[i].x) << i;
    ASSERT_EQ(a[i].y, b[i].y) << i;
    ASSERT_EQ(a[i].on, b[i].on) << i;
  }
}

std::vector<SimEvent> rounded(std::vector<SimEvent> events) {
  for (SimEvent& e : events) e.t = e.t / kNsPerUs * kNsPerUs;
  return events;
}

TEST(ReadOut, WithoutLimitStampsAreRoundedDownAndNothingElseChanges) {
  ReadOut read_out(kSize, {0, 1});
  const auto events = random_events(20000, 10, 1);
  expect_same(run(read_out, events, kNsPerMs), rounded(events));
  EXPECT_EQ(read_out.counts().late, 0);
  EXPECT_EQ(read_out.counts().lost, 0);
}

TEST(ReadOut, BelowTheLimitNothingIsDelayedOrLost) {
  auto events = random_events(20000, 100, 2);
  // At least 50 ns apart: 20 Mev/s at any moment.
  for (std::size_t i = 1; i < events.size(); ++i) events[i].t = std::max(events[i].t, events[i - 1].t + 50);
  ReadOut read_out(kSize, {20, 1});
  expect_same(run(read_out, events, kNsPerMs), rounded(events));
  EXPECT_EQ(read_out.counts().late, 0);
  EXPECT_EQ(read_out.counts().lost, 0);
  EXPECT_EQ(read_out.counts().delivered, 20000);
}

TEST(ReadOut, ABurstLeavesAtTheLimitAndIsLateByWhatItWaits) {
  // 10,000 events in 0.1 ms at 10 Mev/s take 1 ms; all may wait.
  const auto events = random_events(10000, 10, 3);
  ReadOut read_out(kSize, {10, 1000000});
  const auto out = run(read_out, events, kNsPerMs);
  ASSERT_EQ(out.size(), events.size());
  EXPECT_EQ(read_out.counts().lost, 0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const TimeNs slot = events[0].t + 100 * static_cast<TimeNs>(i);
    ASSERT_EQ(out[i].t, slot / kNsPerUs * kNsPerUs) << i;
  }
  EXPECT_GT(read_out.counts().late, 9000);
  EXPECT_LE(read_out.counts().late, 10000);
}

TEST(ReadOut, AFullQueueLosesEventsAndTheRestComesAtTheLimit) {
  // 50 Mev/s in for 10 ms, 8 Mev/s out.
  const auto events = random_events(500000, 20, 4);
  ReadOut read_out(kSize, {8, 3000});
  const auto out = run(read_out, events, 300 * kNsPerUs);
  const auto& counts = read_out.counts();
  EXPECT_EQ(counts.in, 500000);
  EXPECT_EQ(counts.in, counts.delivered + counts.lost);
  EXPECT_EQ(counts.delivered, static_cast<std::int64_t>(out.size()));
  const double seconds = to_seconds(out.back().t - out.front().t);
  EXPECT_NEAR(static_cast<double>(out.size()) / seconds, 8e6, 8e6 * 0.001);
  // What can be read meanwhile, and the queue.
  EXPECT_NEAR(static_cast<double>(counts.delivered), 8e6 * to_seconds(events.back().t - events[0].t) + 3000,
              5);
  // Nobody waits longer than the whole queue takes.
  std::map<std::tuple<int, int>, std::vector<TimeNs>> born;
  for (const SimEvent& e : events) born[{e.x, e.y}].push_back(e.t);
  for (std::size_t i = 0; i < out.size(); ++i) {
    EXPECT_TRUE(i == 0 || out[i].t >= out[i - 1].t);
    const auto& times = born.at({out[i].x, out[i].y});
    const auto next = std::upper_bound(times.begin(), times.end(), out[i].t + kNsPerUs);
    ASSERT_NE(next, times.begin()) << "read before it was born";
  }
}

TEST(ReadOut, RowsAreReadInTurnAndInOrderWithin) {
  std::vector<SimEvent> events;
  for (const std::uint16_t y :
       std::array<std::uint16_t, 3>{150, 3, 70})  // the first is read at once, the others wait
    for (std::uint16_t x = 0; x < 5; ++x) {
      SimEvent e;
      e.t = 1000000 + (y == 150 ? 0 : 10);
      e.x = x;
      e.y = y;
      events.push_back(e);
    }
  ReadOut read_out(kSize, {0.5, 100});
  const auto out = run(read_out, events, kNsPerMs);
  ASSERT_EQ(out.size(), 15u);
  const std::uint16_t rows[] = {150, 3, 70};
  for (std::size_t i = 0; i < out.size(); ++i) {
    EXPECT_EQ(out[i].y, rows[i / 5]);
    EXPECT_EQ(out[i].x, i % 5);
    EXPECT_EQ(out[i].t, 1000000 + 2000 * static_cast<TimeNs>(i));
  }
}

TEST(ReadOut, BlocksDoNotMatter) {
  const auto events = random_events(100000, 40, 6);
  ReadOut one(kSize, {15, 500}), two(kSize, {15, 500});
  expect_same(run(one, events, kNsPerS), run(two, events, 17 * kNsPerUs));
  EXPECT_EQ(one.counts().lost, two.counts().lost);
  EXPECT_GT(one.counts().lost, 0);
}

}  // namespace
}  // namespace evpose::sim
