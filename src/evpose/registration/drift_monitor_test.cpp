// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/drift_monitor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr double kStep_s = 1.0 / 300;

/// Events at a steady rate that start at the contour and drift away; a sum for each update.
void watch(DriftMonitor& monitor, double drift_px_s, double speed_px_s, double sigma_px, int updates,
           int events_each, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma_px > 0 ? sigma_px : 1);
  for (int k = 0; k < updates; ++k) {
    monitor.advance(kStep_s);
    DriftMonitor::Events e;
    for (int i = 0; i < events_each; ++i) {
      const double age = kStep_s * (i + 0.5) / events_each, t = kStep_s * (k + 1) - age;
      const double d = drift_px_s * t + (sigma_px > 0 ? noise(random) : 0);
      e.n += 1, e.age += age, e.distance += d, e.age2 += age * age, e.age_distance += age * d;
    }
    monitor.add(3, e, speed_px_s);
  }
}

TEST(DriftMonitor, MeasuresALinearDriftExactly) {
  for (const double drift : {-200.0, -7.0, 0.0, 31.0}) {
    DriftMonitor monitor({});
    watch(monitor, drift, 100, 0, 20, 5);
    EXPECT_NEAR(monitor.drift(3).px_s, drift, 1e-6);
  }
}

TEST(DriftMonitor, ItsSigmaIsThatOfTheScatter) {
  DriftConfig config;
  config.event_sigma_px = 0.7;
  double square = 0, sigma = 0;
  constexpr int kRuns = 400;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    DriftMonitor monitor(config);
    watch(monitor, 0, 100, 0.7, 30, 10, seed);
    square += std::pow(monitor.drift(3).px_s, 2) / kRuns;
    sigma = monitor.drift(3).sigma_px_s;
  }
  // The weights of older events make the estimate a little worse than the sum of weights says.
  EXPECT_LT(std::sqrt(square), 1.3 * sigma);
  EXPECT_GT(std::sqrt(square), 0.6 * sigma);
}

TEST(DriftMonitor, WhatStandsStillIsTrusted) {
  DriftMonitor monitor({});
  watch(monitor, 0, 100, 0.7, 60, 20);
  EXPECT_DOUBLE_EQ(monitor.trust(3), 1);
  EXPECT_DOUBLE_EQ(monitor.trust(77), 1) << "a cell that nothing is known of";
}

TEST(DriftMonitor, AMovingThingIsNotAndIsForgivenLater) {
  DriftMonitor monitor({});
  watch(monitor, 150, 100, 0.7, 20, 20);
  EXPECT_LT(monitor.trust(3), 0.05);
  for (int k = 0; k < 300; ++k) monitor.advance(kStep_s);
  EXPECT_GT(monitor.trust(3), 0.95);
}

/// The error of a predicted motion grows with the motion: so does the drift that is let pass.
TEST(DriftMonitor, ADriftSmallAgainstTheMotionIsTrusted) {
  DriftMonitor slow({}), fast({});
  watch(slow, 60, 20, 0.7, 30, 20);
  watch(fast, 60, 600, 0.7, 30, 20);
  EXPECT_LT(slow.trust(3), 0.5);
  EXPECT_DOUBLE_EQ(fast.trust(3), 1);
}

}  // namespace
}  // namespace evpose
