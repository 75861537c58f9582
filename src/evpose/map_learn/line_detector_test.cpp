// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/line_detector.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose::map_learn {
namespace {

constexpr double kApart_cells = 6;

/// Counts of `level` a cell on average.
CountImage background(int width, int height, double level, std::mt19937& random) {
  CountImage image{width, height, {}};
  std::poisson_distribution<int> count(level);
  for (int i = 0; i < width * height; ++i) image.counts.push_back(static_cast<float>(count(random)));
  return image;
}

/// Events scattered by `sigma` cells about the line from a to b.
void add_line(CountImage& image, const Eigen::Vector2d& a, const Eigen::Vector2d& b, double per_cell,
              double sigma, std::mt19937& random) {
  std::normal_distribution<double> across(0, sigma);
  std::uniform_real_distribution<double> along(0, 1);
  const Eigen::Vector2d way = b - a, n = Eigen::Vector2d(-way.y(), way.x()).normalized();
  for (int i = 0; i < static_cast<int>(per_cell * way.norm()); ++i) {
    const Eigen::Vector2d p = a + along(random) * way + across(random) * n;
    image.counts[static_cast<std::size_t>(std::lround(p.y())) * static_cast<std::size_t>(image.width) +
                 static_cast<std::size_t>(std::lround(p.x()))] += 1;
  }
}

double distance(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d way = (b - a).normalized(), d = p - a;
  return std::abs(way.x() * d.y() - way.y() * d.x());
}

TEST(LineDetector, FindsALineToAFractionOfACellInAnyDirection) {
  std::mt19937 random(5);
  for (int degrees = 0; degrees < 180; degrees += 15) {
    CountImage image = background(120, 120, 1, random);
    const double turn = degrees / 57.29577951;
    const Eigen::Vector2d middle(60.3, 59.6), half(12 * std::cos(turn), 12 * std::sin(turn));
    add_line(image, middle - half, middle + half, 30, 1, random);
    const auto lines = detect_lines(image, {}, kApart_cells);
    ASSERT_FALSE(lines.empty()) << degrees;
    for (const RidgeLine& l : lines) {
      EXPECT_LT(distance(0.5 * (l.a + l.b), middle - half, middle + half), 0.25) << degrees;
      EXPECT_GT(std::abs((l.b - l.a).normalized().dot(half.normalized())), std::cos(4 / 57.29577951))
          << degrees;
      EXPECT_LT((l.b - l.a).norm(), 27) << degrees;
    }
  }
}

TEST(LineDetector, FindsNothingInCountingNoise) {
  std::mt19937 random(6);
  for (const double level : {0.05, 1.0, 20.0})
    EXPECT_TRUE(detect_lines(background(300, 300, level, random), {}, kApart_cells).empty()) << level;
}

TEST(LineDetector, OfLinesSideBySideTheMoreSignificantStays) {
  std::mt19937 random(7);
  CountImage image = background(120, 120, 1, random);
  add_line(image, {40, 60}, {64, 60}, 30, 0.7, random);
  add_line(image, {40, 68}, {64, 68}, 60, 0.7, random);
  LineDetectorConfig config;
  config.most_length = 60;
  const auto lines = detect_lines(image, config, 10);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NEAR(lines[0].a.y(), 68, 0.5);
  EXPECT_EQ(detect_lines(image, config, 5).size(), 2u);
}

TEST(LineDetector, ALineLongerThanTheLongestBecomesSeveral) {
  std::mt19937 random(8);
  CountImage image = background(160, 60, 1, random);
  add_line(image, {20, 30}, {120, 30}, 40, 1, random);
  const auto lines = detect_lines(image, {}, kApart_cells);
  double length = 0;
  for (const RidgeLine& l : lines) length += (l.b - l.a).norm();
  EXPECT_GE(lines.size(), 4u);
  EXPECT_GT(length, 60);
  EXPECT_LT(length, 110);
}

}  // namespace
}  // namespace evpose::map_learn
