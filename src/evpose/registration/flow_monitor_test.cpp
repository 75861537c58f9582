// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/flow_monitor.h"

#include <gtest/gtest.h>

#include <cmath>

namespace evpose {
namespace {

constexpr double kStep_s = 1.0 / 300;

FilteredEvent event_at(int x, std::uint32_t stamp_us) {
  FilteredEvent e{};
  e.stamp_us = stamp_us;
  e.x = static_cast<std::uint16_t>(x);
  e.y = 4;
  e.on = 1;
  return e;
}

/// An upright edge that moves to the right at `speed_px_s` over a surface; the answers of its events when
/// `expected_px_s` is predicted along the normal (nx, 0).
int agreeing(double speed_px_s, float expected_px_s, float nx = 1) {
  TimeSurface surface(64, 8);
  int agree = 0;
  for (int x = 0; x < 64; ++x) {
    const auto stamp = static_cast<std::uint32_t>(10 + 1e6 * x / speed_px_s);
    surface.insert(x, 4, Polarity::on, stamp);
    agree += x >= 8 && FlowMonitor::compare(surface, event_at(x, stamp), nx, 0, expected_px_s) ==
                           FlowMonitor::Answer::agrees;
  }
  return agree;
}

TEST(FlowMonitor, AnEdgeThatMovesAsPredictedAgrees) {
  EXPECT_EQ(agreeing(100, 100), 56);
  EXPECT_EQ(agreeing(800, 800), 56);
  EXPECT_EQ(agreeing(100, -100, -1), 56) << "the same motion along the other normal";
}

TEST(FlowMonitor, OneThatMovesOtherwiseDoesNot) {
  EXPECT_EQ(agreeing(100, 300), 0);
  EXPECT_EQ(agreeing(100, 40), 0);
  EXPECT_EQ(agreeing(100, -100), 0) << "the way back";
}

TEST(FlowMonitor, SlowContoursTellNothing) {
  const TimeSurface surface(64, 8);
  EXPECT_EQ(FlowMonitor::compare(surface, event_at(20, 1000), 1, 0, 5), FlowMonitor::Answer::unknown);
}

TEST(FlowMonitor, ACellBelowTheUsualShareIsMistrustedAndForgivenLater) {
  FlowMonitor monitor;
  for (int k = 0; k < 20; ++k) {
    monitor.advance(kStep_s);
    for (std::uint32_t cell = 0; cell < 20; ++cell) monitor.add(cell, 7, 3);
    monitor.add(20, 2, 8);
  }
  for (std::uint32_t cell = 0; cell < 20; ++cell) EXPECT_DOUBLE_EQ(monitor.trust(cell), 1);
  EXPECT_LT(monitor.trust(20), 0.05);
  EXPECT_DOUBLE_EQ(monitor.trust(77), 1) << "a cell that nothing is known of";
  for (int k = 0; k < 300; ++k) monitor.advance(kStep_s);
  EXPECT_GT(monitor.trust(20), 0.95);
}

TEST(FlowMonitor, AFewEventsAreNoReason) {
  FlowMonitor monitor;
  for (std::uint32_t cell = 0; cell < 20; ++cell) monitor.add(cell, 70, 30);
  monitor.add(20, 0, 9);
  monitor.add(21, 6, 6);
  EXPECT_DOUBLE_EQ(monitor.trust(20), 1);
  EXPECT_DOUBLE_EQ(monitor.trust(21), 1);
}

}  // namespace
}  // namespace evpose
