// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/filtered_edge_delay.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr double kThreshold = 0.25, kAnyGap = 1e9;
constexpr TrailFilterKind kKinds[] = {TrailFilterKind::none, TrailFilterKind::first, TrailFilterKind::second,
                                      TrailFilterKind::all_but_first};

TEST(FilteredEdgeDelay, WithoutAFilterIsTheClosedForm) {
  for (const double steps : {0.6, 1.0, 1.6, 2.5, 6.0})
    for (const int sign : {-1, 1}) {
      const FilteredEvents numeric = filtered_events(TrailFilterKind::none, steps, kThreshold, sign, 0.1);
      const EdgeDelay closed = edge_delay(steps, kThreshold);
      EXPECT_NEAR(numeric.events, expected_events(steps), 0.01) << steps;
      EXPECT_NEAR(numeric.delay_px, sign > 0 ? closed.on_px : closed.off_px, 0.01) << steps << ' ' << sign;
    }
}

TEST(FilteredEdgeDelay, WhatAFilterKeepsAndWhatItDropsAreAll) {
  for (const double steps : {1.5, 3.0, 7.0})
    for (const int sign : {-1, 1})
      for (const double gap_px : {0.05, 0.2, 0.5, kAnyGap}) {
        const auto of = [&](TrailFilterKind kind) {
          return filtered_events(kind, steps, kThreshold, sign, gap_px);
        };
        const FilteredEvents all = of(TrailFilterKind::none), first = of(TrailFilterKind::first),
                             rest = of(TrailFilterKind::all_but_first);
        EXPECT_NEAR(first.events + rest.events, all.events, 1e-9);
        EXPECT_NEAR(first.events * first.delay_px + rest.events * rest.delay_px, all.events * all.delay_px,
                    1e-9);
      }
}

/// Pixels whose logarithm walks before the edge comes, as edge_delay_test.cpp draws them, by brute force.
TEST(FilteredEdgeDelay, IsThatOfPixelsBehindTheFilter) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const TrailFilterKind kind : kKinds)
    for (const double steps : {1.4, 2.6, 5.0})
      for (const int sign : {-1, 1})
        for (const double gap_px : {0.15, kAnyGap}) {
          const double height = sign * steps * kThreshold;
          double events = 0, place_px = 0;
          constexpr int kPixels = 20'000;
          for (int pixel = 0; pixel < kPixels; ++pixel) {
            // The sum of two uniform numbers has the odds of a triangle.
            double next = uniform(random) + uniform(random), before_px = -1e12;
            for (int in_trail = 0; next <= steps; ++next) {
              const double at_px = (std::exp(sign * next * kThreshold) - 1) / (std::exp(height) - 1);
              in_trail = at_px - before_px < gap_px ? in_trail + 1 : 1;
              before_px = at_px;
              const bool kept = kind == TrailFilterKind::none ||
                                (kind == TrailFilterKind::first && in_trail == 1) ||
                                (kind == TrailFilterKind::second && in_trail == 2) ||
                                (kind == TrailFilterKind::all_but_first && in_trail > 1);
              if (kept) ++events, place_px += at_px;
            }
          }
          const FilteredEvents law = filtered_events(kind, steps, kThreshold, sign, gap_px);
          EXPECT_NEAR(law.events, events / kPixels, 0.02) << static_cast<int>(kind) << ' ' << steps;
          if (events < 0.01 * kPixels) continue;
          EXPECT_NEAR(law.delay_px, place_px / events - 0.5, 0.02) << static_cast<int>(kind) << ' ' << steps;
        }
}

TEST(FilteredEdgeDelay, TheTableFindsTheStepByItsEvents) {
  // Where the number of events tells the step: all but the first, up to where trails last.
  const FilteredEdgeDelay table({TrailFilterKind::all_but_first, 1}, kThreshold);
  for (const double steps : {2.0, 3.0, 5.0}) {
    const auto of = [&](int sign) {
      return filtered_events(TrailFilterKind::all_but_first, steps, kThreshold, sign, kAnyGap);
    };
    const auto [delay, sigma_px] = table(of(1).events, 100);
    EXPECT_NEAR(delay.on_px, of(1).delay_px, 0.03) << steps;
    EXPECT_NEAR(delay.off_px, of(-1).delay_px, 0.03) << steps;
    EXPECT_LT(sigma_px, 0.08);
  }
}

TEST(FilteredEdgeDelay, SaysThatTheFirstEventDoesNotTellTheStep) {
  const FilteredEdgeDelay table({TrailFilterKind::first, 1}, kThreshold);
  const FilteredEdgeDelay::Value full = table(1, 100);
  EXPECT_GT(full.sigma_px, 0.1);
  // A step of three thresholds makes one event, as one of ten does.
  for (const double steps : {3.0, 6.0})
    EXPECT_NEAR(filtered_events(TrailFilterKind::first, steps, kThreshold, 1, kAnyGap).delay_px,
                full.delay.on_px, 2.5 * full.sigma_px);
  EXPECT_LT(full.delay.on_px, edge_delay(1.5, kThreshold).on_px - 0.1);
}

TEST(FilteredEdgeDelay, IsFiniteWhateverIsAsked) {
  for (const TrailFilterKind kind : kKinds)
    for (const double gap_s : {1e-6, 0.01, 10.0}) {
      const FilteredEdgeDelay table({kind, gap_s}, kThreshold);
      for (const double events : {-1.0, 0.0, 0.3, 1.0, 4.0, 100.0})
        for (const double speed : {0.0, 1.0, 100.0, 1e5}) {
          const auto [delay, sigma_px] = table(events, speed);
          EXPECT_LE(std::abs(delay.on_px), 0.5);
          EXPECT_LE(std::abs(delay.off_px), 0.5);
          EXPECT_TRUE(std::isfinite(sigma_px) && sigma_px >= 0);
        }
    }
}

}  // namespace
}  // namespace evpose
