// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/event_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "evpose/core/parallel.h"

namespace evpose::sim {
namespace {

EventPixelConfig faultless() {
  EventPixelConfig c;
  c.threshold = 0.24;
  c.threshold_spread = c.refractory_s = c.stray_light = c.shot_noise_hz = c.hot_share = c.start_spread = 0;
  return c;
}

struct Stamped {
  TimeNs t;
  int x, y;
  bool on;
  bool operator==(const Stamped&) const = default;
};

// Events of pictures `step` apart, radiance(pixel, t_s) of each.
std::vector<Stamped> run(EventPixels pixels, std::size_t count, TimeNs step, TimeNs end, int threads,
                         const std::function<double(std::size_t pixel, double t_s)>& radiance) {
  ThreadPool pool(threads);
  std::vector<float> picture(count);
  std::vector<Stamped> all;
  EventPacket packet;
  for (TimeNs t = 0; t <= end; t += step) {
    for (std::size_t i = 0; i < count; ++i) picture[i] = static_cast<float>(radiance(i, to_seconds(t)));
    if (t == 0) {
      pixels.start(t, picture);
      continue;
    }
    packet.events.clear();
    pixels.advance(t, picture, pool, packet);
    for (const Event& e : packet.events) all.push_back({packet.time(e), e.x, e.y, e.on != 0});
  }
  return all;
}

// Share of pixel `x` that an edge moving right at one pixel in 10 ms has passed, which starts to the left of
// pixel 0.
double passed(std::size_t x, double t_s) {
  return std::clamp(t_s / 10e-3 - static_cast<double>(x), 0.0, 1.0);
}

TEST(EventPixels, StepEdgeGivesLogContrastOverThresholdEventsAtTheRightTimes) {
  for (const bool brighter : {true, false}) {
    const double from = brighter ? 0.1 : 0.6, to = brighter ? 0.6 : 0.1;
    const auto events = run(EventPixels({8, 1}, faultless(), 1), 8, 500 * kNsPerUs, 90 * kNsPerMs, 1,
                            [&](std::size_t x, double t) { return from + (to - from) * passed(x, t); });
    ASSERT_EQ(events.size(), 8u * 7u);  // ln 6 / 0.24 = 7.47
    std::map<int, int> seen;
    for (const Stamped& e : events) {
      EXPECT_EQ(e.on, brighter);
      const int k = ++seen[e.x];
      const double level = from * std::exp((brighter ? 1 : -1) * k * 0.24);
      const double expected_s = 10e-3 * (e.x + (level - from) / (to - from));
      EXPECT_NEAR(to_seconds(e.t), expected_s, 2e-6) << e.x << " " << k;
    }
  }
}

TEST(EventPixels, ResetHoldsThePixelForTheRefractoryTime) {
  EventPixelConfig config = faultless();
  config.refractory_s = 100e-6;
  // One pixel brightens six-fold in 1 ms: after each event the reference is that of 0.1 ms later.
  const auto events = run(EventPixels({1, 1}, config, 1), 1, 1000 * kNsPerUs, 3 * kNsPerMs, 1,
                          [&](std::size_t, double t) { return 0.1 + 0.5 * std::min(1.0, t / 1e-3); });
  std::vector<double> expected_s;
  for (double reference = 0.1;;) {
    const double t = (reference * std::exp(0.24) - 0.1) / 0.5 * 1e-3;
    if (t > 1e-3) break;
    expected_s.push_back(t);
    reference = 0.1 + 0.5 * (t + 100e-6) / 1e-3;
  }
  ASSERT_EQ(events.size(), expected_s.size());
  EXPECT_LT(events.size(), 7u);
  for (std::size_t i = 0; i < events.size(); ++i) EXPECT_NEAR(to_seconds(events[i].t), expected_s[i], 2e-6);
}

TEST(EventPixels, ThresholdsSpreadAsConfigured) {
  EventPixelConfig config = faultless();
  config.threshold = 0.25;
  config.threshold_spread = 0.03;
  constexpr int kSide = 100;
  // Log intensity rises by 0.01 per picture: the first event tells the threshold.
  const auto events = run(EventPixels({kSide, kSide}, config, 3), kSide * kSide, kNsPerMs, 45 * kNsPerMs, 1,
                          [](std::size_t, double t) { return 0.2 * std::exp(10 * t); });
  std::map<std::pair<int, int>, double> first;
  for (const Stamped& e : events) first.try_emplace({e.x, e.y}, 10 * to_seconds(e.t));
  ASSERT_EQ(first.size(), 1u * kSide * kSide);
  double sum = 0, sum2 = 0;
  for (const auto& [pixel, threshold] : first) sum += threshold, sum2 += threshold * threshold;
  const auto count = static_cast<double>(first.size());
  const double mean = sum / count;
  EXPECT_NEAR(mean, 0.25, 0.002);
  EXPECT_NEAR(std::sqrt(sum2 / count - mean * mean), 0.03, 0.002);
}

TEST(EventPixels, NoiseComesAtItsRateAndNotWithoutOne) {
  EventPixelConfig config = faultless();
  const auto still = [](std::size_t, double) { return 0.3; };
  EXPECT_TRUE(run(EventPixels({64, 64}, config, 1), 64 * 64, kNsPerMs, kNsPerS, 1, still).empty());
  config.shot_noise_hz = 2;
  const auto events = run(EventPixels({64, 64}, config, 1), 64 * 64, 5 * kNsPerMs, kNsPerS, 1, still);
  const auto count = static_cast<double>(events.size());
  EXPECT_NEAR(count, 8192, 4 * std::sqrt(8192));
  const auto on =
      static_cast<double>(std::count_if(events.begin(), events.end(), [](const Stamped& e) { return e.on; }));
  EXPECT_NEAR(on, 0.5 * count, 2 * std::sqrt(8192));
}

TEST(EventPixels, HotPixelsFireWithinTheirRange) {
  EventPixelConfig config = faultless();
  config.hot_share = 0.01;
  const auto events = run(EventPixels({64, 64}, config, 1), 64 * 64, 5 * kNsPerMs, 4 * kNsPerS, 1,
                          [](std::size_t, double) { return 0.3; });
  std::map<std::pair<int, int>, int> count;
  for (const Stamped& e : events) ++count[{e.x, e.y}];
  EXPECT_NEAR(static_cast<double>(count.size()), 41, 20);
  for (const auto& [pixel, n] : count) {
    EXPECT_GT(n, 4 * config.hot_min_hz * 0.5);
    EXPECT_LT(n, 4 * config.hot_max_hz * 1.2);
  }
}

TEST(EventPixels, EventsAreSortedSpacedAndTheSameForAnyThreads) {
  const auto picture = [](std::size_t i, double t) {
    return 0.3 + 0.25 * std::sin(40 * t + 0.01 * double(i));
  };
  const auto events =
      run(EventPixels({128, 96}, {}, 7), 128 * 96, 700 * kNsPerUs, 200 * kNsPerMs, 1, picture);
  ASSERT_GT(events.size(), 10000u);
  std::map<std::pair<int, int>, TimeNs> last;
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_LE(events[i - (i > 0)].t, events[i].t);
    const auto [before, is_first] = last.try_emplace({events[i].x, events[i].y}, events[i].t);
    EXPECT_TRUE(is_first || events[i].t - before->second >= 99 * kNsPerUs);
    before->second = events[i].t;
  }
  EXPECT_EQ(run(EventPixels({128, 96}, {}, 7), 128 * 96, 700 * kNsPerUs, 200 * kNsPerMs, 2, picture), events);
  EXPECT_NE(run(EventPixels({128, 96}, {}, 8), 128 * 96, 700 * kNsPerUs, 200 * kNsPerMs, 2, picture), events);
}

}  // namespace
}  // namespace evpose::sim
