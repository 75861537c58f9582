// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/arc_corners.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace evpose::experiments {
namespace {

constexpr ImageSize kImage{80, 80};

struct Fired {
  double t_ms;
  int x, y;
};

/// One event of each pixel at `time(x, y)` ms, late by up to 0.2 ms at random, in order of time: those that
/// are corners.
template <class Time>
std::vector<Fired> corners_of(const Time& time) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> late(0, 0.2);
  std::vector<Fired> fired, out;
  for (int y = 0; y < kImage.height; ++y)
    for (int x = 0; x < kImage.width; ++x) fired.push_back({time(x, y) + late(random), x, y});
  std::sort(fired.begin(), fired.end(), [](const Fired& a, const Fired& b) { return a.t_ms < b.t_ms; });
  ArcCorners detector(kImage);
  for (const Fired& f : fired)
    if (detector.is_corner(static_cast<TimeNs>(1e6 * (f.t_ms + 1000)), f.x, f.y, true)) out.push_back(f);
  return out;
}

TEST(ArcCorners, AStraightEdgeHasNone) {
  for (const double angle : {0.0, 0.4, 0.9, 1.5, 2.4})
    EXPECT_TRUE(corners_of([&](int x, int y) { return x * std::cos(angle) + y * std::sin(angle); }).empty())
        << angle;
}

TEST(ArcCorners, AMovingRightAngleIsFoundAlongItsWayAndNowhereElse) {
  // A quadrant whose corner moves along the diagonal, a pixel a millisecond.
  const auto found = corners_of([](int x, int y) { return static_cast<double>(std::max(x, y)); });
  std::vector<bool> on_the_way(static_cast<std::size_t>(kImage.width), false);
  for (const Fired& f : found) {
    EXPECT_LE(std::abs(f.x - f.y), 3) << f.x << " " << f.y;
    on_the_way[static_cast<std::size_t>(std::max(f.x, f.y))] = true;
  }
  EXPECT_GT(std::count(on_the_way.begin(), on_the_way.end(), true), kImage.width / 2);
}

TEST(ArcCorners, TheRestOfABurstIsNone) {
  ArcCorners detector(kImage);
  TimeNs t = kNsPerS;
  for (int x = 37; x < 40; ++x)
    for (int y = 37; y < 40; ++y) detector.is_corner(t += kNsPerUs, x, y, true);
  for (int k = 0; k < 10; ++k) EXPECT_FALSE(detector.is_corner(t += kNsPerMs, 38, 38, true));
}

TEST(ArcCorners, AnArcIsACornerByItsLengthAlone) {
  for (int length = 3; length <= 15; ++length) {
    std::vector<TimeNs> times(16);
    for (int k = 0; k < 16; ++k) {  // newest at both ends of the arc
      const TimeNs in_arc = 100 + std::abs(2 * k - (length - 1));
      times[static_cast<std::size_t>((k + 5) % 16)] = k < length ? in_arc : k % 2;
    }
    const bool corner = (length >= 3 && length <= 6) || (length >= 10 && length <= 13);
    EXPECT_EQ(has_corner_arc(times, 3, 6), corner) << length;
  }
}

}  // namespace
}  // namespace evpose::experiments
