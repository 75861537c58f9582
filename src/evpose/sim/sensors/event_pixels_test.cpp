// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/event_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

namespace evpose::sim {
namespace {

// No faults but what the test sets; no dark current to speak of.
EventCameraConfig faultless() {
  EventCameraConfig c;
  c.threshold_on = c.threshold_off = 0.24;
  c.threshold_sigma = c.refractory_us = c.bandwidth_hz_per_cd_m2 = c.leak_hz = 0;
  c.shot_noise_dark_hz = c.shot_noise_bright_hz = c.hot_pixel_fraction = c.reference_spread = 0;
  c.dark_cd_m2 = 1e-4;
  return c;
}

using LightCurve = std::function<double(double t_s)>;

// Events of one pixel whose light is known at the times of `grid`, linear between.
std::vector<SimEvent> watch(EventPixels& pixels, std::size_t pixel, const std::vector<TimeNs>& grid,
                            const LightCurve& light) {
  std::vector<SimEvent> events;
  float from = static_cast<float>(light(to_seconds(grid[0])));
  pixels.start(pixel, grid[0], from);
  for (std::size_t i = 1; i < grid.size(); ++i) {
    const auto to = static_cast<float>(light(to_seconds(grid[i])));
    pixels.advance(pixel, grid[i - 1], grid[i], from, to, events);
    from = to;
  }
  return events;
}

std::vector<TimeNs> even_grid(TimeNs step, TimeNs end) {
  std::vector<TimeNs> grid;
  for (TimeNs t = 0; t <= end; t += step) grid.push_back(t);
  return grid;
}

// An edge that runs to the right at one pixel in 10 ms, starting at the left border of pixel 0.
double edge(std::size_t column, double from, double to, double t_s) {
  return from + (to - from) * std::clamp(t_s / 10e-3 - static_cast<double>(column), 0.0, 1.0);
}

TEST(EventPixels, MovingStepEdgeGivesLogContrastOverThresholdEventsAtTheRightTimes) {
  EventPixels pixels({8, 1}, faultless(), 1);
  const auto grid = even_grid(500 * kNsPerUs, 90 * kNsPerMs);
  for (const bool brighter : {true, false}) {
    const double from = brighter ? 10 : 60, to = brighter ? 60 : 10;
    for (std::size_t x = 0; x < 8; ++x) {
      const auto events = watch(pixels, x, grid, [&](double t) { return edge(x, from, to, t); });
      ASSERT_EQ(events.size(), 7u);  // ln 6 / 0.24 = 7.47
      for (std::size_t k = 0; k < events.size(); ++k) {
        EXPECT_EQ(events[k].on, brighter);
        EXPECT_EQ(events[k].x, x);
        EXPECT_EQ(events[k].y, 0);
        EXPECT_EQ(events[k].cause, EventCause::signal);
        const double level = from * std::exp((brighter ? 1 : -1) * 0.24 * static_cast<double>(k + 1));
        const double expected_s = 10e-3 * (static_cast<double>(x) + (level - from) / (to - from));
        EXPECT_NEAR(to_seconds(events[k].t), expected_s, 0.2e-6) << x << " " << k;
      }
    }
  }
}

TEST(EventPixels, DarkCurrentReducesTheContrast) {
  EventCameraConfig config = faultless();
  config.dark_cd_m2 = 5;
  EventPixels pixels({1, 1}, config, 1);
  const auto events =
      watch(pixels, 0, even_grid(kNsPerMs, 20 * kNsPerMs), [](double t) { return edge(0, 10, 60, t); });
  EXPECT_EQ(events.size(), 6u);  // ln(65 / 15) / 0.24 = 6.1
}

TEST(EventPixels, ResetHoldsThePixelForTheRefractoryTime) {
  EventCameraConfig config = faultless();
  config.refractory_us = 100;
  EventPixels pixels({1, 1}, config, 1);
  // Six-fold in 1 ms: after each event the reference is that of 0.1 ms later.
  for (const TimeNs step : {kNsPerMs, 30 * kNsPerUs}) {
    const auto events = watch(pixels, 0, even_grid(step, 3 * kNsPerMs),
                              [](double t) { return 10 + 50 * std::min(1.0, t / 1e-3); });
    std::vector<double> expected_s;
    for (double reference = 10;;) {
      const double t = (reference * std::exp(0.24) - 10) / 50 * 1e-3;
      if (t > 1e-3) break;
      expected_s.push_back(t);
      reference = 10 + 50 * std::min(1.0, (t + 100e-6) / 1e-3);
    }
    ASSERT_EQ(events.size(), expected_s.size());
    EXPECT_LT(events.size(), 7u);
    // 30 us is no divisor of 1 ms: there the curve bends up to 30 us late.
    const double tolerance_s = step == kNsPerMs ? 0.2e-6 : 3e-6;
    for (std::size_t i = 0; i < events.size(); ++i)
      EXPECT_NEAR(to_seconds(events[i].t), expected_s[i], tolerance_s);
  }
}

// Log luminance of a pixel after its low pass, measured by events of a small threshold.
struct LogCurve {
  std::vector<double> t_s, log;
};
LogCurve behind_low_pass(const EventCameraConfig& base, double start, const std::vector<TimeNs>& grid,
                         const LightCurve& light) {
  EventCameraConfig config = base;
  config.threshold_on = config.threshold_off = 0.02;
  EventPixels pixels({1, 1}, config, 1);
  LogCurve curve;
  double log = start;
  for (const SimEvent& e : watch(pixels, 0, grid, light)) {
    log += e.on ? 0.02F : -0.02F;
    curve.t_s.push_back(to_seconds(e.t));
    curve.log.push_back(log);
  }
  return curve;
}

TEST(EventPixels, LowPassAnswersASmallStepWithItsTimeConstant) {
  EventCameraConfig config = faultless();
  config.bandwidth_hz_per_cd_m2 = 2;
  config.bandwidth_max_hz = 500;
  for (const double level : {5.0, 20.0, 1000.0}) {
    // Up by 0.09 within a nanosecond, then constant.
    const double high = level * std::exp(0.09);
    const double tau_s = (1 / 500.0 + 1 / (2 * high)) / (2 * std::numbers::pi);
    for (const TimeNs step : {kNsPerS, 100 * kNsPerUs}) {
      std::vector<TimeNs> grid = {0, 1};
      for (TimeNs t = step; t <= kNsPerS; t += step) grid.push_back(t);
      const auto curve =
          behind_low_pass(config, std::log(level), grid, [&](double t) { return t > 0 ? high : level; });
      ASSERT_EQ(curve.t_s.size(), 4u);
      for (std::size_t i = 0; i < curve.t_s.size(); ++i) {
        const double expected = 0.09 * (1 - std::exp(-curve.t_s[i] / tau_s));
        EXPECT_NEAR(curve.log[i] - std::log(level), expected, 2e-5) << level << " " << step;
      }
    }
  }
}

TEST(EventPixels, LowPassLagsBehindARampByItsTimeConstant) {
  EventCameraConfig config = faultless();
  config.bandwidth_hz_per_cd_m2 = 1e6;  // so that only the largest counts
  config.bandwidth_max_hz = 50;
  const double tau_s = 1 / (2 * std::numbers::pi * 50);
  for (const double rate : {3.0, -3.0}) {  // of log luminance, 1/s
    const auto curve = behind_low_pass(config, std::log(20.0), even_grid(200 * kNsPerUs, kNsPerS),
                                       [&](double t) { return 20 * std::exp(rate * t); });
    ASSERT_GT(curve.t_s.size(), 140u);
    for (std::size_t i = 0; i < curve.t_s.size(); ++i) {
      const double t = curve.t_s[i];
      const double expected = rate * (t - tau_s * (1 - std::exp(-t / tau_s)));
      EXPECT_NEAR(curve.log[i] - std::log(20.0), expected, 1e-4);
    }
  }
}

TEST(EventPixels, LowPassSlowsTheDarkMore) {
  EventCameraConfig config = faultless();
  config.bandwidth_hz_per_cd_m2 = 100;
  EventPixels pixels({1, 1}, config, 1);
  TimeNs last = 0;
  for (const double level : {1000.0, 10.0, 1.0, 0.1}) {
    const auto events = watch(pixels, 0, even_grid(kNsPerMs, kNsPerS),
                              [&](double t) { return level * (t > 0.5e-3 ? 2 : 1); });
    ASSERT_EQ(events.size(), 2u);
    EXPECT_GT(events[1].t, last);
    last = events[1].t;
  }
}

TEST(EventPixels, LargeStepThroughTheLowPassDoesNotDependOnHowItIsCut) {
  EventCameraConfig config = faultless();
  config.bandwidth_hz_per_cd_m2 = 5;
  EventPixels pixels({1, 1}, config, 1);
  const LightCurve light = [](double t) { return edge(0, 2, 100, t); };
  const auto whole = watch(pixels, 0, even_grid(10 * kNsPerMs, 100 * kNsPerMs), light);
  const auto pieces = watch(pixels, 0, even_grid(50 * kNsPerUs, 100 * kNsPerMs), light);
  ASSERT_EQ(whole.size(), 16u);  // ln 50 / 0.24 = 16.3
  ASSERT_EQ(pieces.size(), whole.size());
  for (std::size_t i = 0; i < whole.size(); ++i)
    EXPECT_NEAR(to_seconds(whole[i].t), to_seconds(pieces[i].t), 20e-6);
}

TEST(EventPixels, WithoutLowPassALineGivesTheSameEventsHoweverItIsCut) {
  EventCameraConfig config;
  config.bandwidth_hz_per_cd_m2 = 0;
  config.shot_noise_dark_hz = config.shot_noise_bright_hz = 40;
  config.leak_hz = 2;
  constexpr int kCount = 200;
  EventPixels pixels({kCount, 1}, config, 5);
  EventPixels again({kCount, 1}, config, 5);
  const auto whole_grid = even_grid(250 * kNsPerMs, kNsPerS);
  std::vector<TimeNs> fine_grid;
  for (TimeNs t = 0; t < kNsPerS; t += 1'234'567) fine_grid.push_back(t);
  for (const TimeNs t : whole_grid) fine_grid.push_back(t);
  std::sort(fine_grid.begin(), fine_grid.end());
  fine_grid.erase(std::unique(fine_grid.begin(), fine_grid.end()), fine_grid.end());
  std::size_t count = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    Random random(i);
    std::vector<double> corner;
    for (int k = 0; k < 5; ++k) corner.push_back(random.uniform(5, 200));
    const LightCurve light = [&](double t) {
      const int k = std::min(3, static_cast<int>(t * 4));
      return corner[k] + (corner[k + 1] - corner[k]) * (t * 4 - k);
    };
    const auto whole = watch(pixels, i, whole_grid, light);
    const auto pieces = watch(again, i, fine_grid, light);
    ASSERT_EQ(pieces.size(), whole.size());
    count += whole.size();
    for (std::size_t k = 0; k < whole.size(); ++k) {
      // A luminance of a grid point is a float: good to 6e-8 of itself, 6e-8 of log luminance.
      EXPECT_NEAR(to_seconds(whole[k].t), to_seconds(pieces[k].t), 2e-6);
      EXPECT_EQ(whole[k].on, pieces[k].on);
      EXPECT_EQ(whole[k].cause, pieces[k].cause);
    }
  }
  EXPECT_GT(count, 5000u);
}

TEST(EventPixels, ThresholdsSpreadAsConfiguredOnAndOffApart) {
  EventCameraConfig config = faultless();
  config.threshold_on = 0.25;
  config.threshold_off = 0.3;
  config.threshold_sigma = 0.03;
  constexpr int kSide = 100;
  EventPixels pixels({kSide, kSide}, config, 3);
  const auto grid = even_grid(kNsPerMs, 50 * kNsPerMs);
  double sum[2] = {}, squares[2] = {}, product = 0;
  for (std::size_t i = 0; i < kSide * kSide; ++i) {
    double threshold[2] = {};
    for (const bool on : {false, true}) {  // the first event of a log ramp tells
      const auto events =
          watch(pixels, i, grid, [&](double t) { return 20 * std::exp((on ? 10 : -10) * t); });
      ASSERT_FALSE(events.empty());
      threshold[on] = 10 * to_seconds(events[0].t);
      sum[on] += threshold[on];
      squares[on] += threshold[on] * threshold[on];
    }
    product += threshold[0] * threshold[1];
  }
  const double count = kSide * kSide, mean_off = sum[0] / count, mean_on = sum[1] / count;
  EXPECT_NEAR(mean_on, 0.25, 0.0015);  // 5 sigma of the mean
  EXPECT_NEAR(mean_off, 0.3, 0.0015);
  EXPECT_NEAR(std::sqrt(squares[1] / count - mean_on * mean_on), 0.03, 0.0011);
  EXPECT_NEAR(std::sqrt(squares[0] / count - mean_off * mean_off), 0.03, 0.0011);
  EXPECT_NEAR((product / count - mean_on * mean_off) / (0.03 * 0.03), 0, 0.05);
}

TEST(EventPixels, FirstReferencesLieAnywhereBetweenTheThresholds) {
  EventCameraConfig config = faultless();
  config.reference_spread = 1;
  constexpr int kCount = 4000;
  EventPixels pixels({kCount, 1}, config, 3);
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto events =
        watch(pixels, i, even_grid(kNsPerMs, 60 * kNsPerMs), [](double t) { return 20 * std::exp(10 * t); });
    ASSERT_FALSE(events.empty());
    for (const SimEvent& e : events) EXPECT_EQ(e.cause, EventCause::signal);
    const double left = 10 * to_seconds(events[0].t);  // up to the first event: uniform in 0 .. 0.48
    sum += left;
    squares += left * left;
  }
  EXPECT_NEAR(sum / kCount, 0.24, 0.011);
  EXPECT_NEAR(squares / kCount - std::pow(sum / kCount, 2), 0.48 * 0.48 / 12, 0.0015);
}

// Pixels in lanes, and those that stay behind one by one, trigger the events of pixels one by one.
TEST(EventPixels, EightAtOnceAreEightTimesOne) {
  for (const double bandwidth : {0.0, 20.0}) {
    EventCameraConfig config;
    config.bandwidth_hz_per_cd_m2 = bandwidth;
    config.shot_noise_dark_hz = config.shot_noise_bright_hz = 10;
    EventPixels together({kLanes, 1}, config, 9), apart({kLanes, 1}, config, 9);
    Random random(1);
    std::array<float, kLanes> from, to;
    std::vector<SimEvent> a, b;
    int quiet = 0;
    for (std::size_t i = 0; i < kLanes; ++i) {
      from[i] = static_cast<float>(random.uniform(1, 100));
      together.start(i, 0, from[i]);
      apart.start(i, 0, from[i]);
    }
    for (TimeNs t = 0; t < kNsPerS; t += kNsPerMs) {
      for (float& v : to)
        v = from[&v - to.data()] * static_cast<float>(std::exp(random.uniform(-0.06, 0.06)));
      const IntLanes wanted = kLaneNumbers != static_cast<std::int32_t>(t / kNsPerMs % 9);
      const unsigned done =
          together.advance_quiet(0, t, t + kNsPerMs, load(from.data()), load(to.data()), wanted);
      quiet += std::popcount(done);
      for (std::size_t i = 0; i < kLanes; ++i) {
        if ((done >> i & 1) == 0) together.advance(i, t, t + kNsPerMs, from[i], to[i], a);
        apart.advance(i, t, t + kNsPerMs, from[i], to[i], b);
      }
      from = to;
    }
    EXPECT_GT(quiet, 5000);
    EXPECT_GT(a.size(), 100U);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      ASSERT_EQ(a[i].t, b[i].t);
      ASSERT_EQ(a[i].x, b[i].x);
      ASSERT_EQ(a[i].on, b[i].on);
    }
  }
}

struct Counts {
  std::map<EventCause, double> causes;
  double on = 0, all = 0;
};
Counts count_still(const EventCameraConfig& config, double level, int side, TimeNs end) {
  EventPixels pixels({side, side}, config, 11);
  Counts counts;
  const auto grid = even_grid(20 * kNsPerMs, end);
  for (std::size_t i = 0; i < static_cast<std::size_t>(side) * side; ++i)
    for (const SimEvent& e : watch(pixels, i, grid, [&](double) { return level; })) {
      ++counts.causes[e.cause];
      counts.on += e.on;
      ++counts.all;
    }
  return counts;
}

TEST(EventPixels, NothingHappensWithoutACause) {
  EXPECT_EQ(count_still(faultless(), 30, 32, kNsPerS).all, 0);
  EventCameraConfig slow = faultless();
  slow.bandwidth_hz_per_cd_m2 = 1;
  EXPECT_EQ(count_still(slow, 30, 32, kNsPerS).all, 0);
}

TEST(EventPixels, ShotNoiseComesAtTheRateOfItsLight) {
  for (const double bandwidth : {0.0, 100.0}) {
    EventCameraConfig config = faultless();
    config.bandwidth_hz_per_cd_m2 = bandwidth;
    config.shot_noise_dark_hz = 4;
    config.shot_noise_bright_hz = 1;
    config.shot_noise_half_cd_m2 = 10;
    for (const double level : {0.0, 10.0, 1e6}) {
      const Counts counts = count_still(config, level, 48, kNsPerS);
      const double expected = 48 * 48 * (1 + 3 / (1 + level / 10));
      EXPECT_NEAR(counts.causes.at(EventCause::shot), expected, 4 * std::sqrt(expected)) << level;
      EXPECT_EQ(counts.all, counts.causes.at(EventCause::shot));
      EXPECT_NEAR(counts.on, 0.5 * expected, 4 * std::sqrt(0.5 * expected));
    }
  }
}

TEST(EventPixels, LeakMakesOnEventsAtItsRate) {
  for (const double bandwidth : {0.0, 100.0}) {
    EventCameraConfig config = faultless();
    config.bandwidth_hz_per_cd_m2 = bandwidth;
    config.leak_hz = 2;
    config.reference_spread = 1;
    config.refractory_us = 100;
    const Counts counts = count_still(config, 30, 32, 4 * kNsPerS);
    // A start between the thresholds delays or hastens the first event by up to half a second.
    EXPECT_NEAR(counts.all, 32 * 32 * 7.5, 4 * 32 * std::sqrt(1.0 / 3));
    EXPECT_EQ(counts.on, counts.all);
    EXPECT_EQ(counts.causes.at(EventCause::leak), counts.all);
  }
}

TEST(EventPixels, HotPixelsFireWithinTheirRange) {
  EventCameraConfig config = faultless();
  config.hot_pixel_fraction = 0.02;
  constexpr int kCount = 4096;
  EventPixels pixels({kCount, 1}, config, 1);
  const auto grid = even_grid(5 * kNsPerMs, 4 * kNsPerS);
  double hot = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto events = watch(pixels, i, grid, [](double) { return 30; });
    if (events.empty()) continue;
    ++hot;
    for (const SimEvent& e : events) EXPECT_EQ(e.cause, EventCause::hot);
    EXPECT_GT(events.size(), 4 * config.hot_min_hz * 0.5);
    EXPECT_LT(events.size(), 4 * config.hot_max_hz * 1.2);
  }
  EXPECT_NEAR(hot, 0.02 * kCount, 4 * std::sqrt(0.02 * kCount));
}

TEST(EventPixels, EventsOfAPixelAreSortedAndSpacedByTheReset) {
  EventPixels pixels({64, 1}, {}, 7);
  std::size_t count = 0;
  for (std::size_t i = 0; i < 64; ++i) {
    TimeNs last = -kNsPerS;
    const double pace = 30 + static_cast<double>(i);
    for (const SimEvent& e : watch(pixels, i, even_grid(333'333, kNsPerS),
                                   [&](double t) { return 40 + 38 * std::sin(pace * t); })) {
      EXPECT_GE(e.t - last, 100 * kNsPerUs);
      last = e.t;
      ++count;
    }
  }
  EXPECT_GT(count, 5000u);
}

TEST(EventPixels, SameSeedSameEventsAndPixelsDoNotShareTheirs) {
  const auto run = [](std::uint64_t seed, std::size_t pixel) {
    EventPixels pixels({4, 1}, {}, seed);
    std::vector<TimeNs> stamps;
    for (const SimEvent& e : watch(pixels, pixel, even_grid(kNsPerMs, kNsPerS),
                                   [](double t) { return 40 + 38 * std::sin(20 * t); }))
      stamps.push_back(e.t);
    return stamps;
  };
  EXPECT_EQ(run(1, 2), run(1, 2));
  EXPECT_NE(run(1, 2), run(2, 2));
  EXPECT_NE(run(1, 2), run(1, 3));
}

}  // namespace
}  // namespace evpose::sim
