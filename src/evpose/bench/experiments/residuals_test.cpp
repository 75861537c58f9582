// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/residuals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace evpose::experiments {
namespace {

constexpr ImageSize kSize{320, 240};
constexpr double kPeriod_s = 1.0 / 300, kSpeed_px_s = 90;

/// A straight contour of several segments that sweeps the image to the right, its events where it was a while
/// ago, and clutter that grows denser across it.
class StraightEdge {
 public:
  StraightEdge(double delay_px, double clutter_per_px2, const std::vector<double>& offsets_px)
      : delay_px_(delay_px), clutter_per_px2_(clutter_per_px2), offsets_px_(offsets_px) {
    map_.points.resize(30 * offsets_px.size());
  }

  std::vector<ContourLook> looks(double seconds) {
    EventRegistration registration(kSize, {}, static_cast<std::uint32_t>(offsets_px_.size()));
    LookCounter counter(kSize, map_);
    const Matrix6d covariance = Matrix6d::Zero();
    for (int k = 1; k * kPeriod_s < seconds; ++k) {
      step(k * kPeriod_s);
      counter.add({events_, stamp(k * kPeriod_s), kPeriod_s, samples_, covariance}, k * kPeriod_s,
                  registration);
    }
    return counter.looks();
  }

 private:
  static std::uint32_t stamp(double t_s) { return static_cast<std::uint32_t>(std::lround(1e6 * t_s)); }

  void step(double t_s) {
    events_.clear();
    samples_.clear();
    const double x = 20 + kSpeed_px_s * t_s;
    const auto per_segment = static_cast<int>(200 / 6 / offsets_px_.size());
    for (std::uint32_t segment = 0; segment < offsets_px_.size(); ++segment)
      for (int i = 0; i < per_segment; ++i) {
        ContourSample s;
        s.jacobian.setZero();
        s.pixel = {x, 20.0 + 6 * (i + per_segment * static_cast<int>(segment))};
        s.normal_px = {1, 0};
        s.speed_px_s = kSpeed_px_s;
        s.segment = segment;
        samples_.push_back(s);
        add_events(s.pixel, offsets_px_[segment], t_s);
      }
    std::sort(events_.begin(), events_.end(),
              [](const FilteredEvent& a, const FilteredEvent& b) { return a.stamp_us < b.stamp_us; });
  }

  void add_events(const Eigen::Vector2d& at, double offset_px, double t_s) {
    std::uniform_real_distribution<double> unit(0, 1);
    for (int row = -3; row < 3; ++row) {
      // Every pixel that the edge passes within the period, at the time when it is past by delay and offset.
      const int middle = static_cast<int>(at.x());
      for (int column = middle - 8; column < middle + 8; ++column) {
        const double passed_s =
            (at.x() - column - delay_px_ + offset_px) / kSpeed_px_s + 0.002 * (unit(random_) - 0.5);
        if (passed_s >= 0 && passed_s < kPeriod_s) add(column, at.y() + row, t_s - passed_s);
        const double across = column - at.x();
        const double density = clutter_per_px2_ * (1 + 0.2 * std::clamp(across, -4.0, 4.0));
        if (unit(random_) < density) add(column, at.y() + row, t_s - unit(random_) * kPeriod_s);
      }
    }
  }

  void add(int x, double y, double t_s) {
    FilteredEvent e{};
    e.stamp_us = stamp(t_s);
    e.x = static_cast<std::uint16_t>(x);
    e.y = static_cast<std::uint16_t>(std::lround(y) & 0x7FFF);
    e.on = 1;
    events_.push_back(e);
  }

  double delay_px_, clutter_per_px2_;
  std::vector<double> offsets_px_;
  ContourMap map_;
  std::vector<ContourSample> samples_;
  std::vector<FilteredEvent> events_;
  std::mt19937 random_{5};
};

LookScatter measured(const std::vector<ContourLook>& looks) {
  std::vector<const ContourLook*> all;
  for (const ContourLook& l : looks) all.push_back(&l);
  return scatter_of(all, [](const ContourLook& l) { return l.measured_px(); });
}

TEST(Residuals, TheDelayOfAStraightEdgeIsMeasuredThroughClutter) {
  for (const double delay_px : {0.0, 0.15, 0.3})
    for (const double clutter : {0.0, 0.1}) {
      const LookScatter all = measured(StraightEdge(delay_px, clutter, {0, 0, 0}).looks(2.5));
      EXPECT_GE(all.looks, 100);
      EXPECT_NEAR(all.mean_px, -delay_px, 0.01) << clutter;
      EXPECT_LT(all.sigma_px, 0.03) << clutter;
    }
}

TEST(Residuals, LastingOffsetsOfSegmentsAreScatterThatStaysCorrelated) {
  const std::vector<double> offsets{0.2, -0.1, -0.1, 0.15, -0.15};
  const auto looks = StraightEdge(0.1, 0.02, offsets).looks(2.5);
  const LookScatter all = measured(looks);
  EXPECT_NEAR(all.mean_px, -0.1, 0.02);
  EXPECT_NEAR(all.sigma_px, 0.145, 0.02);
  for (const LookCorrelation& c : correlation_over_time(looks)) {
    EXPECT_GT(c.pairs, 50);
    EXPECT_NEAR(c.correlation, 1, 0.15);
  }
}

TEST(Residuals, TheMemoryOfAnOffsetIsFound) {
  constexpr double kMemory_s = 0.5;
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::vector<ContourLook> looks;
  const double fall = std::exp(-LookCounter::kBlock_s / kMemory_s);
  for (std::uint32_t segment = 0; segment < 1600; ++segment) {
    double lasting = 0.15 * normal(random);
    for (std::int64_t block = 0; block < 40; ++block) {
      ContourLook look;
      look.segment = segment;
      look.block = block;
      const double middle = lasting + 0.1 * normal(random);
      for (int i = 0; i < 40; ++i) look.on.add(std::clamp(middle + 0.1 * normal(random), -0.9, 0.9));
      looks.push_back(look);
      lasting = fall * lasting + 0.15 * std::sqrt(1 - fall * fall) * normal(random);
    }
  }
  const LookMemory memory = memory_of(correlation_over_time(looks));
  EXPECT_NEAR(memory.time_s, kMemory_s, 0.12);
  EXPECT_NEAR(memory.share, 0.0225 / 0.0325, 0.08);
}

TEST(Residuals, TheNoiseOfFewEventsIsNoScatter) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  std::vector<ContourLook> looks;
  for (std::int64_t block = 0; block < 4000; ++block) {
    ContourLook look;
    look.segment = static_cast<std::uint32_t>(block % 10);
    look.block = block / 10;
    for (int i = 0; i < 20; ++i) look.on.add(std::clamp(0.2 * normal(random), -0.9, 0.9));
    looks.push_back(look);
  }
  EXPECT_LT(measured(looks).sigma_px, 0.02);
  EXPECT_NEAR(looks[0].variance_px2(), 0.04 / 20, 0.001);
}

}  // namespace
}  // namespace evpose::experiments
