// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/contour_profiles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr ImageSize kSize{640, 480};
constexpr std::uint32_t kNow_us = 1'000'000;
constexpr double kSpan_s = 0.008;

/// Samples all over the image, upright and level in turn, moving across themselves.
std::vector<ContourSample> some_samples(int count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<ContourSample> samples;
  for (int i = 0; i < count; ++i) {
    ContourSample s;
    s.jacobian.setZero();
    s.pixel = {60 + 520 * u(random), 60 + 360 * u(random)};
    s.normal_px = i % 2 == 0 ? Eigen::Vector2d(1, 0) : Eigen::Vector2d(0, 1);
    s.speed_px_s = 200 * (u(random) - 0.5);
    samples.push_back(s);
  }
  return samples;
}

std::vector<std::uint32_t> slots_of(const std::vector<ContourSample>& samples) {
  std::vector<std::uint32_t> slots;
  for (std::size_t i = 0; i < samples.size(); ++i) slots.push_back(static_cast<std::uint32_t>(i));
  return slots;
}

/// The image moves, turns about its middle and is scaled; one sigma of each is some pixels.
Eigen::MatrixXd rows_of(const std::vector<ContourSample>& samples) {
  Eigen::MatrixXd rows(samples.size(), 4);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector2d from_middle = samples[i].pixel - Eigen::Vector2d(320, 240),
                          n = samples[i].normal_px;
    rows.row(static_cast<Eigen::Index>(i)) << 4 * n.x(), 4 * n.y(),
        0.006 * n.dot(Eigen::Vector2d(-from_middle.y(), from_middle.x())), 0.006 * n.dot(from_middle);
  }
  return rows;
}

/// Events at this distance across a sample, spread over the span.
void add_events(const ContourSample& s, double px, std::mt19937& random, std::vector<FilteredEvent>& out) {
  std::uniform_real_distribution<double> age(0, kSpan_s);
  for (int k = 0; k < 4; ++k) {
    const double age_s = age(random);
    const Eigen::Vector2d at = s.pixel + (px - s.speed_px_s * age_s) * s.normal_px;
    out.push_back({kNow_us - static_cast<std::uint32_t>(1e6 * age_s),
                   static_cast<std::uint16_t>(std::lround(at.x())),
                   static_cast<std::uint16_t>(static_cast<int>(std::lround(at.y())) & 0x7fff), 1});
  }
}

TEST(ContourProfiles, CountsAreHighestWhereAContourReallyIs) {
  const auto samples = some_samples(60);
  std::mt19937 random(1);
  std::vector<FilteredEvent> events;
  for (const ContourSample& s : samples) add_events(s, 3, random, events);
  ContourProfiles profiles(kSize, samples.size(), 8);
  profiles.add(events, kNow_us, kSpan_s, samples, slots_of(samples));
  profiles.finish();
  const auto at = [&](double px) { return profiles.score(Eigen::VectorXd::Constant(60, px)); };
  for (const double px : {-8.0, -5.0, -3.0, 0.0, 1.0, 5.0, 8.0}) EXPECT_GT(at(3), at(px) + 20) << px;
  EXPECT_EQ(at(50), 0) << "beyond the reach nothing is known";
}

/// Beside each contour stand three that are not looked for, all on one side, and a third of those that are
/// looked for have no events.
TEST(ContourProfiles, FindTheDisplacementAmongEdgesThatNobodyLooksFor) {
  const auto samples = some_samples(400);
  const Eigen::MatrixXd rows = rows_of(samples);
  for (unsigned run = 0; run < 6; ++run) {
    std::mt19937 random(20 + run);
    std::normal_distribution<double> normal;
    const Eigen::Vector4d truth = Eigen::Vector4d::NullaryExpr([&] { return normal(random); });
    const Eigen::VectorXd px = rows * truth;
    std::uniform_real_distribution<double> beside(2, 12);
    std::vector<FilteredEvent> events;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double at = px(static_cast<Eigen::Index>(i));
      if (i % 3 != 0) add_events(samples[i], at, random, events);
      for (int k = 0; k < 3; ++k) add_events(samples[i], at + beside(random), random, events);
    }
    ContourProfiles profiles(kSize, samples.size(), 24);
    profiles.add(events, kNow_us, kSpan_s, samples, slots_of(samples));
    profiles.finish();
    const auto found = most_gathering(profiles, rows, 8);
    ASSERT_FALSE(found.empty());
    EXPECT_LE(found.size(), 8U);
    const double off_px = (rows * (found[0] - truth)).norm() / std::sqrt(400.0);
    EXPECT_LT(off_px, 0.5) << run;
    for (std::size_t a = 0; a < found.size(); ++a)
      for (std::size_t b = 0; b < a; ++b) EXPECT_GT((rows * (found[a] - found[b])).norm(), std::sqrt(400.0));
  }
}

}  // namespace
}  // namespace evpose
