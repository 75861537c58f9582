// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/edge_delay.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace evpose {
namespace {

constexpr double kThreshold = 0.25;

/// Log luminance since a pixel's last event, as it is found now and then while texture moves it to and fro.
std::vector<double> texture_before() {
  constexpr int kSteps = 50;  // of the walk, for a threshold
  std::mt19937 random(7);
  std::uniform_real_distribution<double> within(-0.5, 0.5);
  std::vector<double> out(20'000);
  int at = 0;
  for (double& value : out) {
    for (int i = 0; i < 501; ++i) {
      at += random() % 2 == 0 ? 1 : -1;
      if (std::abs(at) == kSteps) at = 0;
    }
    value = kThreshold * (at + within(random)) / kSteps;
  }
  return out;
}

/// Events and their mean place of such pixels, over which an edge then moves evenly.
struct Drawn {
  double events = 0, place = 0;
};
Drawn draw(double steps, int sign) {
  static const std::vector<double> before = texture_before();
  const double height = steps * kThreshold, ratio = std::expm1(sign * height);
  Drawn out;
  for (const double since_event : before)
    for (double next = kThreshold - sign * since_event; next <= height; next += kThreshold) {
      out.place += std::expm1(sign * next) / ratio;
      ++out.events;
    }
  out.place /= out.events;
  out.events /= static_cast<double>(before.size());
  return out;
}

TEST(EdgeDelay, IsThatOfPixelsWhoseBrightnessWalkedBefore) {
  for (const double steps : {0.6, 1.0, 1.5, 2.5, 4.0, 6.0})
    for (const int sign : {-1, 1}) {
      const Drawn drawn = draw(steps, sign);
      const EdgeDelay delay = edge_delay(steps, kThreshold);
      EXPECT_NEAR(sign > 0 ? delay.on_px : delay.off_px, drawn.place - 0.5, 0.012) << steps << ' ' << sign;
      EXPECT_NEAR(expected_events(steps), drawn.events, 0.03 * drawn.events + 0.01) << steps;
    }
}

TEST(EdgeDelay, OfAFaintStepIsASixthOfAPixel) {
  const EdgeDelay faint = edge_delay(0, kThreshold);
  EXPECT_NEAR(faint.on_px, 1.0 / 6, 2e-3);
  EXPECT_NEAR(faint.off_px, 1.0 / 6, 2e-3);
}

TEST(EdgeDelay, OfAHighStepIsTheMeanOfALogarithm) {
  // The first thresholds do not count any more: mean of (e^y - 1) / (e^h - 1) over y = 0..h.
  const double steps = 400, small = 0.005, height = steps * small;
  const EdgeDelay delay = edge_delay(steps, small);
  const double bright = 1 / height - 1 / std::expm1(height);
  EXPECT_NEAR(delay.on_px, bright - 0.5, 2e-3);
  EXPECT_NEAR(delay.off_px, 0.5 - bright, 2e-3);
}

TEST(EdgeDelay, TheStepIsFoundFromItsEvents) {
  for (const double steps : {0.1, 0.5, 1.0, 1.2, 5.0})
    EXPECT_NEAR(step_of_events(expected_events(steps)), steps, 1e-12);
}

TEST(EdgeDelay, IsSmoothWhereTheFirstThresholdIsReached) {
  const EdgeDelay below = edge_delay(1 - 1e-6, kThreshold), above = edge_delay(1 + 1e-6, kThreshold);
  EXPECT_NEAR(below.on_px, above.on_px, 1e-5);
  EXPECT_NEAR(below.off_px, above.off_px, 1e-5);
}

TEST(EdgeDelay, TheTableHoldsTheClosedForm) {
  for (const double threshold : {0.1, kThreshold, 0.5}) {
    const EdgeDelayTable table(threshold);
    for (double steps = 0; steps < 15; steps += 0.01) {
      const EdgeDelay read = table(steps), exact = edge_delay(steps, threshold);
      EXPECT_NEAR(read.on_px, exact.on_px, 1e-3) << steps;
      EXPECT_NEAR(read.off_px, exact.off_px, 1e-3) << steps;
    }
  }
}

}  // namespace
}  // namespace evpose
