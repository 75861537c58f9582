// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/edge_lines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr ImageSize kSize{320, 240};

double uniform(std::mt19937& random) { return (static_cast<double>(random()) + 0.5) / 4294967296.0; }

FilteredEvent event_at(double x, double y, bool on) {
  FilteredEvent e{};
  e.x = static_cast<std::uint16_t>(std::lround(x));
  e.y = static_cast<std::uint16_t>(std::lround(y)) & 0x7FFF;
  e.on = on ? 1 : 0;
  return e;
}

/// Events on a share of the pixels of a straight edge.
void add_line(const EdgeLine& line, double share, bool on, std::mt19937& random,
              std::vector<FilteredEvent>& events) {
  const double length = (line.to - line.from).norm();
  for (double s = 0; s <= length; s += 1)
    if (uniform(random) < share) {
      const Eigen::Vector2d at = line.from + s / length * (line.to - line.from);
      events.push_back(event_at(at.x(), at.y(), on));
    }
}

void add_noise(int count, std::mt19937& random, std::vector<FilteredEvent>& events) {
  for (int i = 0; i < count; ++i)
    events.push_back(event_at(uniform(random) * 319, uniform(random) * 239, uniform(random) < 0.5));
}

/// Of the ends from the other line.
double distance_px(const EdgeLine& found, const EdgeLine& truth) {
  const Eigen::Vector2d along = (truth.to - truth.from).normalized();
  const auto across = [&](const Eigen::Vector2d& p) {
    return std::abs(along.x() * (p.y() - truth.from.y()) - along.y() * (p.x() - truth.from.x()));
  };
  return std::max(across(found.from), across(found.to));
}

TEST(EdgeLineFinder, FindsDottedLinesInNoiseToAPixel) {
  std::mt19937 random(1);
  const std::vector<EdgeLine> truth{
      {{30, 40}, {250, 60}}, {{200, 30}, {180, 200}}, {{40, 200}, {140, 120}}, {{260, 90}, {262, 220}}};
  std::vector<FilteredEvent> events;
  for (std::size_t i = 0; i < truth.size(); ++i) add_line(truth[i], 0.7, i % 2 == 0, random, events);
  add_noise(1500, random, events);
  const std::vector<EdgeLine> found = EdgeLineFinder(kSize).find(events);
  for (const EdgeLine& line : truth) {
    double found_px = 0;
    for (const EdgeLine& f : found)
      if (distance_px(f, line) < 1.5) found_px += (f.to - f.from).norm();
    EXPECT_GT(found_px, 0.7 * (line.to - line.from).norm()) << line.from.transpose();
  }
}

TEST(EdgeLineFinder, FindsNextToNothingInNoise) {
  std::mt19937 random(2);
  std::vector<FilteredEvent> events;
  add_noise(4000, random, events);
  double length = 0;
  for (const EdgeLine& line : EdgeLineFinder(kSize).find(events)) length += (line.to - line.from).norm();
  EXPECT_LT(length, 200);  // of 4000 events
}

TEST(EdgeLineFinder, TheOrderOfEventsMakesNoDifference) {
  std::mt19937 random(3);
  std::vector<FilteredEvent> events;
  add_line({{30, 40}, {250, 60}}, 0.7, true, random, events);
  add_line({{40, 200}, {140, 120}}, 0.7, true, random, events);
  add_noise(1500, random, events);
  EdgeLineFinder finder(kSize);
  const auto one = finder.find(events);
  std::reverse(events.begin(), events.end());
  const auto other = finder.find(events);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].from, other[i].from);
    EXPECT_EQ(one[i].to, other[i].to);
  }
}

}  // namespace
}  // namespace evpose
