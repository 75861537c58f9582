// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/clock_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace evpose {
namespace {

constexpr double kStep_s = 0.0025;

/// A rig that turns by a random walk of rates that is drawn back to rest.
std::vector<double> random_rates(double duration_s) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::vector<double> out;
  double rate = 0, drive = 0;
  for (double t = 0; t < duration_s; t += kStep_s) {
    drive += -drive * kStep_s / 0.1 + normal(random) * std::sqrt(kStep_s) * 8;
    rate += kStep_s * (drive - rate) / 0.2;
    out.push_back(rate);
  }
  return out;
}

std::vector<ImuSample> imu_of(const std::vector<double>& rates, double begin_s) {
  std::vector<ImuSample> out;
  for (std::size_t i = 0; i < rates.size(); ++i) {
    ImuSample s;
    s.t = from_seconds(begin_s + kStep_s * static_cast<double>(i));
    s.gyro = {0.3 * rates[i], rates[i], -0.5 * rates[i]};
    s.accel = {0, 0, 9.81};
    out.push_back(s);
  }
  return out;
}

/// Events from `from_s` to `to_s` of the rates, on a clock that shows 0 then; some come without turning.
EventSummary events_of(const std::vector<double>& rates, double from_s, double to_s) {
  std::mt19937 random(8);
  EventSurvey survey;
  for (double t = from_s; t + kStep_s < to_s; t += kStep_s) {
    const double rate = std::abs(rates[static_cast<std::size_t>(t / kStep_s)]);
    const int count = std::poisson_distribution<int>(4 + 60 * rate)(random);
    EventPacket packet;
    packet.base = from_seconds(t - from_s);
    for (int k = 0; k < count; ++k)
      packet.events.push_back(make_event(static_cast<std::uint32_t>(2400 * k / count), 5, 5, true));
    if (!packet.empty()) survey.add(packet);
  }
  return survey.finish();
}

TEST(ClockOffset, IsFoundWhereEventsComeAsTheRigTurns) {
  const auto rates = random_rates(60);
  const auto imu = imu_of(rates, 1000.0);
  for (const double from_s : {0.0, 17.123, 41.5}) {
    const auto found = find_clock_offset(events_of(rates, from_s, from_s + 12), imu);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->offset_s, 1000.0 + from_s, 5e-3);
    EXPECT_GT(found->correlation, 0.8);
    EXPECT_EQ(found->as_read, 0) << "they have no time in common";
  }
}

TEST(ClockOffset, OfOneClockIsZeroAndAsReadIsAsGood) {
  const auto rates = random_rates(20);
  const auto found = find_clock_offset(events_of(rates, 0, 20), imu_of(rates, 0));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->offset_s, 0, 5e-3);
  EXPECT_NEAR(found->as_read, found->correlation, 0.02);
}

TEST(ClockOffset, IsNotToldByMotionThatRepeatsOrRests) {
  std::vector<double> periodic, rest;
  for (int i = 0; i < 8000; ++i) periodic.push_back(std::sin(6 * kStep_s * i)), rest.push_back(0.001);
  EXPECT_FALSE(find_clock_offset(events_of(periodic, 3, 15), imu_of(periodic, 0)));
  EXPECT_FALSE(find_clock_offset(events_of(rest, 3, 15), imu_of(rest, 0)));
}

TEST(ClockOffset, IsNotToldByTwoSeconds) {
  const auto rates = random_rates(60);
  EXPECT_FALSE(find_clock_offset(events_of(rates, 10, 12), imu_of(rates, 0)));
  EXPECT_FALSE(find_clock_offset({}, imu_of(rates, 0)));
}

}  // namespace
}  // namespace evpose
