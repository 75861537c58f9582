// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/read_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
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

ReadOut queue(double max_rate_mev_s, int capacity) {
  ReadOutConfig c;
  c.kind = ReadOutKind::queue;
  c.max_rate_mev_s = max_rate_mev_s;
  c.queue_events = capacity;
  return {kSize, c, 1};
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
  ReadOut read_out = queue(0, 1);
  const auto events = random_events(20000, 10, 1);
  expect_same(run(read_out, events, kNsPerMs), rounded(events));
  EXPECT_EQ(read_out.counts().late, 0);
  EXPECT_EQ(read_out.counts().lost, 0);
}

TEST(ReadOut, BelowTheLimitNothingIsDelayedOrLost) {
  auto events = random_events(20000, 100, 2);
  // At least 50 ns apart: 20 Mev/s at any moment.
  for (std::size_t i = 1; i < events.size(); ++i) events[i].t = std::max(events[i].t, events[i - 1].t + 50);
  ReadOut read_out = queue(20, 1);
  expect_same(run(read_out, events, kNsPerMs), rounded(events));
  EXPECT_EQ(read_out.counts().late, 0);
  EXPECT_EQ(read_out.counts().lost, 0);
  EXPECT_EQ(read_out.counts().delivered, 20000);
}

TEST(ReadOut, ABurstLeavesAtTheLimitAndIsLateByWhatItWaits) {
  // 10,000 events in 0.1 ms at 10 Mev/s take 1 ms; all may wait.
  const auto events = random_events(10000, 10, 3);
  ReadOut read_out = queue(10, 1000000);
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
  ReadOut read_out = queue(8, 3000);
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
  ReadOut read_out = queue(0.5, 100);
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
  ReadOut one = queue(15, 500), two = queue(15, 500);
  expect_same(run(one, events, kNsPerS), run(two, events, 17 * kNsPerUs));
  EXPECT_EQ(one.counts().lost, two.counts().lost);
  EXPECT_GT(one.counts().lost, 0);
}

ReadOut with(const std::function<void(ReadOutConfig&)>& set, std::uint64_t seed = 1) {
  ReadOutConfig c;
  c.kind = ReadOutKind::queue;
  c.max_rate_mev_s = 0;
  set(c);
  return {kSize, c, seed};
}

double mean_delay_ns(const std::vector<SimEvent>& events, const std::vector<SimEvent>& out) {
  double sum = 0;
  for (const SimEvent& e : out) sum += static_cast<double>(e.t);
  for (const SimEvent& e : events) sum -= static_cast<double>(e.t);
  return sum / static_cast<double>(events.size());
}

void expect_in_order_of_time(const std::vector<SimEvent>& out) {
  for (std::size_t i = 1; i < out.size(); ++i) ASSERT_GE(out[i].t, out[i - 1].t) << i;
}

TEST(RowReadOut, WithoutLoadStampsAreRoundedDownAndNothingElseChanges) {
  auto events = random_events(20000, 100, 2);
  for (std::size_t i = 1; i < events.size(); ++i) events[i].t = std::max(events[i].t, events[i - 1].t + 80);
  ReadOut read_out = with([](ReadOutConfig& c) { c.kind = ReadOutKind::rows, c.max_rate_mev_s = 1000; });
  expect_same(run(read_out, events, kNsPerMs), rounded(events));
  EXPECT_EQ(read_out.counts().late, 0);
}

TEST(RowReadOut, ARowIsReadAtOnceAndTakesTimeByItsWordsOf32Pixels) {
  // Row 9 is read at once; meanwhile rows 5 and 7 fill: 3 and 70 in words 0 and 2, 10 and 20 in word 0.
  std::vector<SimEvent> events(5);
  const int xs[] = {0, 3, 70, 10, 20}, ys[] = {9, 5, 5, 7, 7};
  for (std::size_t i = 0; i < 5; ++i) {
    events[i].t = 1000000 + (i == 0 ? 0 : 10 + static_cast<TimeNs>(i));
    events[i].x = static_cast<std::uint16_t>(xs[i]);
    events[i].y = static_cast<std::uint16_t>(ys[i]);
  }
  // 32 events of a word in 4 us; 2 us per row.
  ReadOut read_out =
      with([](ReadOutConfig& c) { c.kind = ReadOutKind::rows, c.max_rate_mev_s = 8, c.row_ns = 2000; });
  const auto out = run(read_out, events, kNsPerMs);
  ASSERT_EQ(out.size(), 5u);
  const TimeNs times[] = {1000000, 1006000, 1006000, 1016000, 1016000};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(out[i].t, times[i]) << i;
    EXPECT_EQ(out[i].x, xs[i]) << i;
    EXPECT_EQ(out[i].y, ys[i]) << i;
  }
  EXPECT_EQ(read_out.counts().late, 4);
}

TEST(RowReadOut, UnderPoissonLoadTheMeanWaitIsThatOfAQueueWithConstantService) {
  // Many rows, so that a row seldom has two events: M/D/1, mean wait rho S / (2 (1 - rho)).
  constexpr ImageSize kTall{32, 20000};
  ReadOutConfig c;
  c.kind = ReadOutKind::rows;
  c.max_rate_mev_s = 32;  // a word in 1 us
  c.row_ns = 19000;
  const double service_ns = 20000, rho = 0.5;
  auto events = random_events(400000, service_ns / rho, 7);
  Random random(3);
  for (SimEvent& e : events) {
    e.x = static_cast<std::uint16_t>(random.uniform(0, kTall.width));
    e.y = static_cast<std::uint16_t>(random.uniform(0, kTall.height));
  }
  ReadOut read_out(kTall, c, 1);
  const auto out = run(read_out, events, kNsPerMs);
  ASSERT_EQ(out.size(), events.size());
  const double rounding_ns = 500;
  EXPECT_NEAR(mean_delay_ns(events, out) + rounding_ns, rho * service_ns / (2 * (1 - rho)),
              0.02 * service_ns);
}

TEST(RowReadOut, UnderOverloadRowsAreReadInTurnAndAFullRowComesAtTheFullRate) {
  const auto events = random_events(2000000, 1, 8);  // 1000 Mev/s
  ReadOut read_out =
      with([](ReadOutConfig& c) { c.kind = ReadOutKind::rows, c.max_rate_mev_s = 100, c.row_ns = 100; });
  const auto out = run(read_out, events, 50 * kNsPerUs);
  const auto& counts = read_out.counts();
  EXPECT_EQ(counts.in, 2000000);
  EXPECT_EQ(counts.delivered, static_cast<std::int64_t>(out.size()));
  EXPECT_EQ(counts.in, counts.delivered + counts.lost);
  expect_in_order_of_time(out);
  std::map<TimeNs, int> row_at;
  int turns = 0, last = -1;
  for (const SimEvent& e : out) {  // 3.3 us per row: a time has one row
    if (e.t < events[0].t + kNsPerMs || e.t > events.back().t) continue;  // all rows are full
    const auto [at, fresh] = row_at.emplace(e.t, e.y);
    ASSERT_EQ(at->second, e.y);
    if (fresh && last >= 0 && e.y < last) ++turns;
    EXPECT_TRUE(!fresh || turns == 0 || e.y == (last + 1) % 200);
    last = e.y;
  }
  EXPECT_GE(turns, 1);
  // 100 Mev/s for whole words, and the time between rows.
  const double row_ns = 10 * 320 + 100;
  const double seconds = to_seconds(row_at.rbegin()->first - row_at.begin()->first);
  EXPECT_NEAR(static_cast<double>(row_at.size()) * row_ns * 1e-9 / seconds, 1, 0.01);
}

TEST(RowReadOut, APixelWhoseEventWaitsMakesNoOther) {
  std::vector<SimEvent> events(4);
  for (std::size_t i = 0; i < 4; ++i) {
    events[i].t = 1000000 + 100 * static_cast<TimeNs>(i);
    events[i].y = i == 0 ? 3 : 4;  // the second waits for the first
  }
  ReadOut read_out =
      with([](ReadOutConfig& c) { c.kind = ReadOutKind::rows, c.max_rate_mev_s = 100, c.row_ns = 5000; });
  EXPECT_EQ(run(read_out, events, kNsPerMs).size(), 2u);
  EXPECT_EQ(read_out.counts().lost, 2);
}

TEST(ScanReadOut, AFrameHasOneTimeAndTheMeanDelayIsHalfAPeriod) {
  const auto events = random_events(20000, 2000, 9);  // few enough that no pixel has two in a frame
  ReadOut read_out = with([](ReadOutConfig& c) { c.kind = ReadOutKind::scan, c.scan_hz = 5000; });
  const auto out = run(read_out, events, kNsPerMs);
  EXPECT_EQ(read_out.counts().in, read_out.counts().delivered + read_out.counts().lost);
  expect_in_order_of_time(out);
  for (const SimEvent& e : out) ASSERT_EQ(e.t % (200 * kNsPerUs), 0);
  for (std::size_t i = 1; i < out.size(); ++i) {
    EXPECT_TRUE(out[i].t > out[i - 1].t || out[i].x >= out[i - 1].x);
  }
  ASSERT_LT(read_out.counts().lost, 40);
  double born = 0;
  for (const SimEvent& e : events) born += 1e-9 * static_cast<double>(e.t % (200 * kNsPerUs));
  const double read = 200e-6 * static_cast<double>(out.size());
  EXPECT_NEAR((read - born) / static_cast<double>(events.size()), 100e-6, 3e-6);
}

TEST(ScanReadOut, ColumnsWithoutHoldAreReadOneAfterTheOther) {
  const auto events = random_events(50000, 400, 10);
  ReadOut read_out =
      with([](ReadOutConfig& c) { c.kind = ReadOutKind::scan, c.scan_hz = 1000, c.scan_hold = false; });
  const auto out = run(read_out, events, 70 * kNsPerUs);
  expect_in_order_of_time(out);
  for (const SimEvent& e : out) {  // column x at (x + 1) / width of a period
    const double phase = static_cast<double>(e.t % kNsPerMs) / static_cast<double>(kNsPerMs);
    EXPECT_NEAR(std::remainder(phase - (e.x + 1) / 320.0, 1.0), 0, 2e-3);
  }
}

TEST(ScanReadOut, FullFramesTakeLongerThanThePeriod) {
  const auto events = random_events(2000000, 10, 11);  // 100 Mev/s
  ReadOut read_out = with([](ReadOutConfig& c) { c.kind = ReadOutKind::scan, c.max_rate_mev_s = 20; });
  const auto out = run(read_out, events, kNsPerMs);
  EXPECT_EQ(read_out.counts().in, read_out.counts().delivered + read_out.counts().lost);
  std::map<TimeNs, double> frames;
  for (const SimEvent& e : out) ++frames[e.t];
  ASSERT_GT(frames.size(), 5u);
  for (auto frame = frames.begin(); std::next(frame) != frames.end(); ++frame) {
    const double time_us = 1e-3 * static_cast<double>(std::next(frame)->first - frame->first);
    EXPECT_NEAR(time_us, std::max(200.0, frame->second / 20), 1.5);
  }
}

TEST(TrailFilter, KeepsWhatItsKindSays) {
  // Two trails of one polarity, a change of polarity, and a gap: by number of the event.
  const TimeNs times_ms[] = {1, 2, 3, 4, 5, 6, 30, 31};
  const bool ons[] = {true, true, true, false, false, false, false, false};
  const std::map<TrailFilterKind, std::vector<int>> kept = {
      {TrailFilterKind::none, {0, 1, 2, 3, 4, 5, 6, 7}},
      {TrailFilterKind::first, {0, 3, 6}},
      {TrailFilterKind::second, {1, 4, 7}},
      {TrailFilterKind::all_but_first, {1, 2, 4, 5, 7}}};
  for (const auto& [kind, numbers] : kept) {
    ReadOut read_out = with([&](ReadOutConfig& c) { c.trail = kind, c.trail_ms = 10; });
    std::vector<SimEvent> events(8), expected;
    for (std::size_t i = 0; i < 8; ++i) {
      events[i].t = times_ms[i] * kNsPerMs;
      events[i].on = ons[i];
    }
    for (const int i : numbers) expected.push_back(events[static_cast<std::size_t>(i)]);
    expect_same(run(read_out, events, kNsPerMs), expected);
    EXPECT_EQ(read_out.counts().trailing, static_cast<std::int64_t>(8 - numbers.size()));
  }
}

TEST(TrailFilter, PixelsAreApart) {
  const auto events = random_events(20000, 1000, 12);
  ReadOut both = with([](ReadOutConfig& c) { c.trail = TrailFilterKind::first; });
  const auto out = run(both, events, kNsPerMs);
  std::map<std::pair<int, int>, SimEvent> last;
  std::vector<SimEvent> expected;
  for (const SimEvent& e : rounded(events)) {
    const auto [at, fresh] = last.emplace(std::pair<int, int>(e.x, e.y), e);
    if (fresh || at->second.on != e.on || e.t - at->second.t >= 10 * kNsPerMs) expected.push_back(e);
    at->second = e;
  }
  expect_same(out, expected);
  EXPECT_GT(both.counts().trailing, 100);
}

TEST(RateControl, EachPeriodHasTheTargetAtMostAndIsThinnedEvenly) {
  auto events = random_events(300000, 20, 13);  // 50 Mev/s
  const std::size_t quiet = 200000;
  for (std::size_t i = quiet; i < events.size(); ++i)  // then 5 Mev/s
    events[i].t = events[quiet].t + 10 * (events[i].t - events[quiet].t);
  ReadOut read_out = with([](ReadOutConfig& c) { c.rate_control_mev_s = 10; });
  const auto out = run(read_out, events, 130 * kNsPerUs);
  const auto& counts = read_out.counts();
  EXPECT_EQ(counts.in, counts.delivered + counts.shed);
  EXPECT_EQ(counts.delivered, static_cast<std::int64_t>(out.size()));
  std::map<TimeNs, int> before, after;
  for (const SimEvent& e : events) ++before[e.t / RateController::kPeriod];
  double phase = 0, full = 0;
  for (const SimEvent& e : out) ++after[e.t / RateController::kPeriod];
  for (const auto& [period, n] : before) EXPECT_EQ(after[period], std::min(n, 2000)) << period;
  for (const SimEvent& e : out)
    if (before[e.t / RateController::kPeriod] > 9000)
      phase += static_cast<double>(e.t % RateController::kPeriod) / RateController::kPeriod, ++full;
  ASSERT_GT(full, 20000);
  EXPECT_NEAR(phase / full, 0.5, 4 * std::sqrt(1 / 12.0 / full) + 0.0025);
}

TEST(RateControl, TheSeedSelects) {
  const auto events = random_events(50000, 20, 14);
  const auto thin = [&](std::uint64_t seed) {
    ReadOut read_out = with([](ReadOutConfig& c) { c.rate_control_mev_s = 10; }, seed);
    return run(read_out, events, kNsPerMs);
  };
  expect_same(thin(3), thin(3));
  const auto a = thin(3), b = thin(4);
  ASSERT_EQ(a.size(), b.size());
  int same = 0;
  for (std::size_t i = 0; i < a.size(); ++i) same += a[i].x == b[i].x && a[i].y == b[i].y;
  EXPECT_LT(same, 5000);
}

TEST(ReadOut, BlocksDoNotMatterForAnyKindWithAllFilters) {
  const auto events = random_events(100000, 20, 15);
  for (const ReadOutKind kind : {ReadOutKind::queue, ReadOutKind::rows, ReadOutKind::scan}) {
    const auto make = [&] {
      return with([&](ReadOutConfig& c) {
        c.kind = kind, c.max_rate_mev_s = 40, c.trail = TrailFilterKind::all_but_first, c.trail_ms = 100;
        c.queue_events = 500, c.rate_control_mev_s = 1;
      });
    };
    ReadOut one = make(), two = make();
    const auto a = run(one, events, kNsPerS), b = run(two, events, 17 * kNsPerUs);
    expect_same(a, b);
    expect_in_order_of_time(a);
    const auto& n = one.counts();
    EXPECT_EQ(n.in, n.delivered + n.lost + n.trailing + n.shed);
    EXPECT_GT(n.trailing, 0);
    EXPECT_GT(n.delivered, 0);
  }
}

}  // namespace
}  // namespace evpose::sim
