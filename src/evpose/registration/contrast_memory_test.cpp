// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contrast_memory.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

constexpr double kThreshold = 0.25, kSpeed_px_s = 100;

void show(ContrastMemory& memory, double steps, double area_px2) {
  for (int k = 0; k < static_cast<int>(area_px2 / 10); ++k) {
    memory.sweep(0, 10);
    for (int i = 0; i < static_cast<int>(std::lround(std::abs(steps) * 10)); ++i)
      memory.count(0, steps > 0 ? 1 : -1);
  }
}

TEST(ContrastMemory, LearnsSizeAndSignOfAStep) {
  for (double steps : {-4.0, -1.0, 0.5, 3.0}) {
    ContrastMemory memory(1, kThreshold);
    EXPECT_FALSE(memory.known(0));
    show(memory, steps, 2000);
    EXPECT_TRUE(memory.known(0));
    EXPECT_NEAR(memory.steps(0), steps, 0.1 * std::abs(steps)) << steps;
  }
}

TEST(ContrastMemory, ForgetsWhatNoLongerHolds) {
  ContrastMemory memory(1, kThreshold);
  show(memory, 3, 2000);
  show(memory, -3, 2000);  // a free rim against another background
  EXPECT_LT(memory.steps(0), -2);
}

TEST(ContrastMemory, AMapsSignHoldsUntilEventsTellOtherwise) {
  for (const int sign : {-1, 1}) {
    ContrastMemory memory(2, kThreshold);
    memory.seed(0, sign);
    EXPECT_TRUE(memory.known(0));
    EXPECT_FALSE(memory.measured(0));
    EXPECT_FALSE(memory.known(1));
    EXPECT_GE(sign * memory.steps(0), ContrastMemory::kSureSteps);
    EXPECT_EQ(memory.map_contrast(0), -sign);
    EXPECT_DOUBLE_EQ(
        memory.edge_delay(0, kSpeed_px_s).delay.on_px + memory.edge_delay(0, kSpeed_px_s).delay.off_px,
        memory.edge_delay(1, kSpeed_px_s).delay.on_px + memory.edge_delay(1, kSpeed_px_s).delay.off_px);
    show(memory, -sign, 200);
    EXPECT_EQ(memory.map_contrast(0), sign);
  }
}

TEST(ContrastMemory, TextureOfBothSignsCancels) {
  ContrastMemory memory(1, kThreshold);
  for (int i = 0; i < 500; ++i) {
    memory.sweep(0, 1);
    memory.count(0, i % 2 ? 1 : -1);
  }
  EXPECT_LT(std::abs(memory.steps(0)), 0.02);
}

/// Of 100 events in the gates `own` are the step's, the others of texture, as many of either polarity, while
/// the contour moves across itself by the given share of the image's motion.
void show_gate(ContrastMemory& memory, int own, double across) {
  for (int k = 0; k < 50; ++k) memory.count_in_gate(0, own, 100, 50 * across, 50);
}

TEST(ContrastMemory, WhatTextureAddsIsToldByTheWrongPolarity) {
  for (const int sign : {-1, 1})
    for (const int own : {0, 20, 50, 90}) {
      ContrastMemory memory(2, kThreshold);
      EXPECT_DOUBLE_EQ(memory.contour_share(0, kSpeed_px_s, kSpeed_px_s), 0.5);
      show_gate(memory, sign * own, 1);
      const double right = own + 0.5 * (100 - own);
      EXPECT_NEAR(memory.contour_share(0, kSpeed_px_s, kSpeed_px_s), own / right, 0.15) << own;
      EXPECT_DOUBLE_EQ(memory.contour_share(1, kSpeed_px_s, kSpeed_px_s), 0.5);
    }
}

TEST(ContrastMemory, AContourThatSlidesAlongItselfMakesNoEvents) {
  ContrastMemory memory(2, kThreshold);
  show_gate(memory, 60, 0.5);
  const auto odds = [&](std::uint32_t segment, double across) {
    const double share = memory.contour_share(segment, across * kSpeed_px_s, kSpeed_px_s);
    return share / (1 - share);
  };
  for (const std::uint32_t segment : {0U, 1U})
    EXPECT_NEAR(odds(segment, 0.5) / odds(segment, 0.1), 5, 1e-6) << segment;
  EXPECT_NEAR(odds(1, 1), 1, 1e-12);
  EXPECT_LT(memory.contour_share(0, 0, kSpeed_px_s), 0.03);
  EXPECT_DOUBLE_EQ(memory.contour_share(0, 0, 0), 0.5);
  // Seen at half the image's motion, 60 of the contour beside 20 of texture: twice as many would be its own.
  EXPECT_NEAR(memory.contour_share(0, 0.5 * kSpeed_px_s, kSpeed_px_s), 60.0 / 80, 0.1);
}

TEST(ContrastMemory, TheEdgeDelayIsThatOfTheStepWhoseEventsWereCounted) {
  for (const double step : {-3.0, 0.8, 2.0}) {
    ContrastMemory memory(1, kThreshold);
    EXPECT_EQ(memory.edge_delay(0, kSpeed_px_s).delay.on_px, ContrastMemory::kUnknownDelay_px);
    show(memory, std::copysign(expected_events(std::abs(step)), step), 590);
    const EdgeDelay learnt = memory.edge_delay(0, kSpeed_px_s).delay,
                    expected = edge_delay(std::abs(step), kThreshold);
    EXPECT_NEAR(learnt.on_px, expected.on_px, 0.01) << step;
    EXPECT_NEAR(learnt.off_px, expected.off_px, 0.01) << step;
  }
}

}  // namespace
}  // namespace evpose
