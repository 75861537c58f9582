// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/line_lattice.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace evpose {
namespace {

constexpr ImageSize kSize{640, 480};
const Eigen::Vector2d kMiddle(320, 240);

/// Upright lines of a board of `count` lines, seen in perspective.
std::vector<EventLine> seen_lines(int count, const Eigen::Matrix3d& H) {
  std::vector<EventLine> out;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d line = H.inverse().transpose() * Eigen::Vector3d(1, 0, -i);
    const double length = line.head<2>().norm() * (line.x() < 0 ? -1 : 1);
    out.push_back({line.head<2>() / length, -line.z() / length, 100});
  }
  return out;
}

/// Pixels of a lattice with 40 px between its lines, tilted.
Eigen::Matrix3d tilted() {
  Eigen::Matrix3d H;
  H << 40, 3, 120, -4, 38, 90, 4e-3, -2e-3, 1;
  return H;
}

TEST(LineLattice, NumbersAreThoseOfTheLinesWhateverIsMissing) {
  std::vector<EventLine> lines = seen_lines(10, tilted());
  lines.erase(lines.begin() + 6);
  lines.erase(lines.begin() + 2);
  std::ranges::reverse(lines);
  const auto numbered = number_lines(lines, Eigen::Vector2d::UnitX(), kMiddle);
  const std::vector<int> expected{0, 1, 3, 4, 5, 7, 8, 9};
  ASSERT_EQ(numbered.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(numbered[i].number, expected[i]);
}

TEST(LineLattice, LinesOfOtherThingsAreLeftOut) {
  std::vector<EventLine> lines = seen_lines(8, tilted());
  const EventLine between{lines[3].normal, 0.5 * (lines[3].offset + lines[4].offset) + 3, 60};
  lines.push_back(between);
  lines.push_back({Eigen::Vector2d::UnitY(), 100, 200});
  const auto numbered = number_lines(lines, Eigen::Vector2d::UnitX(), kMiddle);
  ASSERT_EQ(numbered.size(), 8U);
  for (const NumberedLine& n : numbered) EXPECT_NE(n.line.offset, between.offset);
}

TEST(LineLattice, TheOtherFamilyIsAnother) {
  EXPECT_TRUE(number_lines(seen_lines(8, tilted()), -Eigen::Vector2d::UnitY(), kMiddle).empty());
}

TEST(EventLines, AreFoundAmongNoise) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> x(0, kSize.width - 1), y(0, kSize.height - 1);
  const EventLine true_lines[] = {{Eigen::Vector2d(1, 0.2).normalized(), 200, 0},
                                  {Eigen::Vector2d(0.1, -1).normalized(), -150, 0}};
  std::vector<FilteredEvent> events;
  const auto add = [&](int px, int py) {
    events.push_back({0, static_cast<std::uint16_t>(px), static_cast<std::uint16_t>(py & 0x7FFF), 1});
  };
  for (int i = 0; i < 2000; ++i) add(x(random), y(random));
  for (const EventLine& line : true_lines)
    for (int s = -700; s < 700; ++s) {
      const Eigen::Vector2d p =
          line.offset * line.normal + s * Eigen::Vector2d(-line.normal.y(), line.normal.x());
      if (kSize.contains(p, 1))
        add(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
    }
  const auto found = find_event_lines(events, kSize);
  ASSERT_GE(found.size(), 2U);
  for (const EventLine& line : true_lines)
    EXPECT_TRUE(std::ranges::any_of(found, [&](const EventLine& f) {
      const double sign = f.normal.dot(line.normal) < 0 ? -1 : 1;
      return (f.normal - sign * line.normal).norm() < 3e-3 && std::abs(f.offset - sign * line.offset) < 0.7;
    }));
  EXPECT_LE(found.size(), 3U);
}

}  // namespace
}  // namespace evpose
