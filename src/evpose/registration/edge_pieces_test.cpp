// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/edge_pieces.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr ImageSize kSize{320, 240};
constexpr std::uint32_t kNow_us = 50'000;

FilteredEvent event(std::uint32_t stamp_us, long x, long y, bool on) {
  FilteredEvent e{};
  e.stamp_us = stamp_us;
  e.x = static_cast<std::uint16_t>(x);
  e.y = static_cast<std::uint16_t>(y & 0x7FFF);
  e.on = on ? 1 : 0;
  return e;
}

/// Events of an edge through `middle` with this normal, which moves along it at `speed_px_s` and is at
/// `middle` now; of the last 20 ms, with 0.4 px of scatter before they are put into pixels.
std::vector<FilteredEvent> edge(const Eigen::Vector2d& middle, const Eigen::Vector2d& normal,
                                double speed_px_s, std::mt19937& random) {
  std::normal_distribution<double> scatter(0, 0.4);
  std::uniform_real_distribution<double> along(-60, 60), age_s(0, 0.02);
  std::vector<FilteredEvent> out;
  for (int i = 0; i < 600; ++i) {
    const double age = age_s(random);
    const Eigen::Vector2d at = middle + along(random) * Eigen::Vector2d(-normal.y(), normal.x()) +
                               (scatter(random) - age * speed_px_s) * normal;
    out.push_back(event(kNow_us - static_cast<std::uint32_t>(1e6 * age), std::lround(at.x()),
                        std::lround(at.y()), true));
  }
  return out;
}

/// Pieces lie on the edge at their own time, to what they state.
TEST(EdgePieces, LieOnTheEdgeAtTheTimeThatTheyTell) {
  std::mt19937 random(4);
  for (const double angle : {0.0, 0.4, 1.2, 2.0, 2.9}) {
    const Eigen::Vector2d normal(std::cos(angle), std::sin(angle)), middle(160, 120);
    constexpr double kSpeed_px_s = 60;
    const auto pieces = EdgePieceFinder(kSize).find(edge(middle, normal, kSpeed_px_s, random), kNow_us);
    ASSERT_GE(pieces.size(), 4u) << angle;
    double square = 0, sum_px = 0;
    for (const EdgePiece& p : pieces) {
      EXPECT_GT(std::abs(p.normal.dot(normal)), 0.95) << angle;
      EXPECT_LT(p.sigma_px, 0.4);
      const double off_px = normal.dot(p.pixel - middle) + p.age_s * kSpeed_px_s;
      EXPECT_LT(std::abs(off_px), 5 * p.sigma_px + 0.3) << angle;
      square += off_px * off_px / (p.sigma_px * p.sigma_px), sum_px += off_px;
    }
    EXPECT_LT(square / static_cast<double>(pieces.size()), 4) << angle;
    EXPECT_LT(std::abs(sum_px / static_cast<double>(pieces.size())), 0.25) << angle;
  }
}

TEST(EdgePieces, NoiseHasFew) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> x(0, kSize.width - 1), y(0, kSize.height - 1), on(0, 1);
  std::vector<FilteredEvent> events;
  for (int i = 0; i < 4000; ++i)
    events.push_back(event(kNow_us - static_cast<std::uint32_t>(i), x(random), y(random), on(random) == 1));
  EXPECT_LT(EdgePieceFinder(kSize).find(events, kNow_us).size(), 10u);
}

TEST(EdgePieces, OneSearchLeavesNothingToTheNext) {
  std::mt19937 random(6);
  const auto first = edge({80, 60}, {1, 0}, 20, random), second = edge({200, 150}, {0, 1}, 20, random);
  EdgePieceFinder used(kSize);
  used.find(first, kNow_us);
  const auto again = used.find(second, kNow_us), alone = EdgePieceFinder(kSize).find(second, kNow_us);
  ASSERT_EQ(again.size(), alone.size());
  for (std::size_t i = 0; i < alone.size(); ++i) EXPECT_EQ(again[i].pixel, alone[i].pixel);
}

TEST(EdgePieces, EventsAtTheBorderAreNoFault) {
  std::vector<FilteredEvent> events;
  for (int i = 0; i < kSize.width; ++i)
    for (const int y : {0, 1, kSize.height - 1}) events.push_back(event(kNow_us, i, y, false));
  EXPECT_TRUE(EdgePieceFinder(kSize).find(events, kNow_us).empty());
  EXPECT_TRUE(EdgePieceFinder({8, 8}).find({}, kNow_us).empty());
}

}  // namespace
}  // namespace evpose
