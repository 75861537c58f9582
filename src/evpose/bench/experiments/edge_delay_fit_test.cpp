// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/edge_delay_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "evpose/registration/edge_delay.h"
#include "evpose/sim/sensors/event_pixels.h"

namespace evpose::experiments {
namespace {

/// A sensor without noise that is never slower in the dark.
sim::EventCameraConfig quiet_sensor() {
  sim::EventCameraConfig config;
  config.bandwidth_hz_per_cd_m2 = config.leak_hz = config.threshold_sigma = config.hot_pixel_fraction = 0;
  config.shot_noise_dark_hz = config.shot_noise_bright_hz = 0;
  return config;
}

/// An edge that brightens or darkens by a factor of luminance, after texture that moved its logarithm to and
/// fro, as the simulated sensor sees it.
struct SensorAtEdge {
  sim::EventCameraConfig config;
  std::size_t pixels = 2000;
  unsigned seed = 3;

  /// Events of the edge's polarity per pixel, and their mean place past the pixel's middle, px along the
  /// motion, with its variance.
  DelaySample look(double log_step, double speed_px_s, bool on) const;

 private:
  void pass(sim::EventPixels& sensor, std::size_t pixel, double ratio, TimeNs crossing, std::mt19937& random,
            std::vector<sim::SimEvent>& events, TimeNs& begin) const;
};

void SensorAtEdge::pass(sim::EventPixels& sensor, std::size_t pixel, double ratio, TimeNs crossing,
                        std::mt19937& random, std::vector<sim::SimEvent>& events, TimeNs& begin) const {
  std::normal_distribution<double> normal;
  TimeNs t = kNsPerMs;
  double level = 20;
  sensor.start(pixel, t, static_cast<float>(level));
  const auto go = [&](double to, TimeNs span) {
    sensor.advance(pixel, t, t + span, static_cast<float>(level), static_cast<float>(to), events);
    level = to, t += span;
  };
  for (int k = 0; k < 1500; ++k) go(level * std::exp(0.012 * normal(random)), 2 * kNsPerMs);
  events.clear();
  begin = t;
  const double before = level;
  for (int k = 1; k <= 50; ++k) go(before * (1 + (ratio - 1) * k / 50), crossing / 50);
  go(level, 2 * kNsPerMs);  // what a low pass has held back
}

DelaySample SensorAtEdge::look(double log_step, double speed_px_s, bool on) const {
  sim::EventPixels sensor({static_cast<int>(pixels), 1}, config, seed + 8);
  std::mt19937 random(seed);
  const TimeNs crossing = from_seconds(1 / speed_px_s) / 50 * 50;
  std::vector<sim::SimEvent> events;
  double sum = 0, square = 0, count = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    TimeNs begin = 0;
    events.clear();
    pass(sensor, i, std::exp((on ? 1 : -1) * log_step), crossing, random, events, begin);
    for (const sim::SimEvent& e : events) {
      if (e.on != on) continue;
      const double place = to_seconds(e.t - begin) / to_seconds(crossing) - 0.5;
      sum += place, square += place * place, ++count;
    }
  }
  const double mean = sum / count;
  return {0,          on,   count / static_cast<double>(pixels),
          speed_px_s, mean, (square / count - mean * mean) / count,
          count};
}

TEST(EdgeDelayLaw, HoldsForTheSimulatedSensor) {
  const SensorAtEdge sensor{quiet_sensor()};
  for (const double steps : {0.7, 1.5, 3.0, 6.0})
    for (const double speed_px_s : {20.0, 300.0}) {
      const EdgeDelay law = edge_delay(steps, 0.25);
      const double log_step = steps * sensor.config.threshold_on;
      EXPECT_NEAR(sensor.look(log_step, speed_px_s, true).late_px, law.on_px, 0.03) << steps << speed_px_s;
      EXPECT_NEAR(sensor.look(log_step, speed_px_s, false).late_px, law.off_px, 0.03) << steps << speed_px_s;
    }
}

/// Looks of a sensor at edges of many contrasts and speeds.
DelaySamples looks_of(const sim::EventCameraConfig& config) {
  DelaySamples out;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> log_step(0.3, 1.8), log_speed(std::log(20.0), std::log(200.0));
  for (unsigned i = 0; i < 240; ++i) {
    const SensorAtEdge sensor{config, 60, 20 + i};
    out.samples.push_back(sensor.look(log_step(random), std::exp(log_speed(random)), i % 2 == 0));
    out.samples.back().segment = i;
  }
  return out;
}

TEST(EdgeDelayFit, FindsTheSimulatedSensorWithinItsSigma) {
  constexpr double kFirstOrder_s = 4e-5;  // what the law leaves of a latency: 0.01 px at the highest speed
  for (const double threshold : {0.18, 0.25, 0.4}) {
    sim::EventCameraConfig config = quiet_sensor();
    config.threshold_on = config.threshold_off = threshold;
    config.bandwidth_hz_per_cd_m2 = 1e6;  // so that only the largest counts
    config.bandwidth_max_hz = 400;
    const DelaySamples looks = looks_of(config);
    const DelayFit fit = fit_delay({&looks}, DelayFreedom::all);
    const double latency_s = 0.5 / (M_PI * config.bandwidth_max_hz);
    EXPECT_NEAR(fit.sensor.threshold, threshold, 2.5 * fit.sigma[0]);
    EXPECT_NEAR(fit.sensor.latency_on_s, latency_s, 2.5 * fit.sigma[1] + kFirstOrder_s);
    EXPECT_NEAR(fit.sensor.latency_off_s, latency_s, 2.5 * fit.sigma[2] + kFirstOrder_s);
    EXPECT_LT(fit.sigma[0], 0.03);
    EXPECT_LT(fit.sigma[1], 1e-4);
    const DelayFit handed = fit_delay({&looks}, DelayFreedom::handed_on);
    EXPECT_EQ(handed.sensor.latency_on_s, handed.sensor.latency_off_s);
    EXPECT_NEAR(handed.sensor.latency_on_s, latency_s, 2.5 * handed.sigma[1] + kFirstOrder_s);
  }
}

TEST(EdgeDelayFit, APauseAfterEachEventTakesEventsAndMovesNoPlace) {
  sim::EventCameraConfig config = quiet_sensor();
  config.refractory_us = 0;
  const SensorAtEdge steady{config};
  config.refractory_us = 500;
  const SensorAtEdge pausing{config};
  for (const bool on : {true, false}) {
    const DelaySample a = steady.look(1, 80, on), b = pausing.look(1, 80, on);
    EXPECT_LT(b.crossing, 0.95 * a.crossing);
    EXPECT_NEAR(b.late_px, a.late_px, 0.02) << on;
  }
}

TEST(EdgeDelayFit, WithTooFewLooksNothingIsMoved) {
  const DelaySamples none;
  const DelayFit fit = fit_delay({&none}, DelayFreedom::all);
  EXPECT_EQ(fit.sensor.threshold, SensorDelay{}.threshold);
  EXPECT_TRUE(std::isinf(fit.sigma[0]));
}

}  // namespace
}  // namespace evpose::experiments
