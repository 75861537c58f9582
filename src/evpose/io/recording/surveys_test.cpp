// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "evpose/io/recording/event_survey.h"
#include "evpose/io/recording/imu_survey.h"
#include "evpose/io/recording/trail_survey.h"

namespace evpose {
namespace {

/// A stream as one packet for each millisecond.
EventSummary survey(const std::vector<std::pair<TimeNs, std::pair<int, int>>>& events) {
  EventSurvey survey;
  for (const auto& [t_us, pixel] : events) {
    EventPacket packet;
    packet.base = t_us * kNsPerUs;
    packet.events.push_back(make_event(0, pixel.first, pixel.second, pixel.first % 3 == 0));
    survey.add(packet);
  }
  return survey.finish();
}

/// Trails of one to five events, 1.5 ms apart, of alternating polarity, 1.6 ms apart; `kept`: of each.
std::optional<double> gap_of_trails(int first_kept, int last_kept) {
  std::mt19937 random(3);
  TrailSurvey survey({8, 8});
  for (int pixel = 0; pixel < 64; ++pixel) {
    TimeNs t = kNsPerMs;
    for (int trail = 0; trail < 200; ++trail) {
      const int length = 1 + static_cast<int>(random() % 5);
      for (int i = 1; i <= length; ++i, t += 3 * kNsPerMs / 2) {
        if (i < first_kept || i > last_kept) continue;
        EventPacket packet;
        packet.base = t;
        packet.events.push_back(make_event(0, pixel % 8, pixel / 8, trail % 2 == 0));
        survey.add(packet);
      }
      t += kNsPerMs / 10;
    }
  }
  return survey.filtered_gap_s();
}

TEST(TrailSurvey, TellsAStreamThatKeepsOneEventOfEachTrail) {
  EXPECT_FALSE(gap_of_trails(1, 5).has_value());
  EXPECT_FALSE(gap_of_trails(2, 5).has_value());
  for (const int kept : {1, 2}) {
    const auto gap_s = gap_of_trails(kept, kept);
    ASSERT_TRUE(gap_s.has_value()) << kept;
    EXPECT_GE(*gap_s, 0.002);
  }
}

TEST(TrailSurvey, SaysNothingOfFewEvents) {
  TrailSurvey survey({4, 4});
  EXPECT_FALSE(survey.filtered_gap_s().has_value());
  EventPacket packet;
  packet.events.push_back(make_event(0, 1, 1, true));
  packet.events.push_back(make_event(9, 60'000, 60'000, true));
  survey.add(packet);
  EXPECT_FALSE(survey.filtered_gap_s().has_value());
}

TEST(EventSurvey, CountsAreThoseOfTheStream) {
  std::vector<std::pair<TimeNs, std::pair<int, int>>> events;
  for (int i = 0; i < 6000; ++i) events.push_back({1000 + 100 * i, {i % 30, (i / 30) % 20}});
  const EventSummary s = survey(events);
  EXPECT_EQ(s.count, 6000);
  EXPECT_EQ(s.on, 2000);
  EXPECT_EQ(s.first, 1'000'000);
  EXPECT_EQ(s.last, (1000 + 100 * 5999) * kNsPerUs);
  EXPECT_EQ(s.widest_x, 29);
  EXPECT_EQ(s.highest_y, 19);
  EXPECT_EQ(s.active_pixels, 600);
  EXPECT_EQ(s.most_at_once, 1);
  EXPECT_EQ(s.bins.size(), 60u);
  for (const auto n : s.bins) EXPECT_EQ(n, 100);
  EXPECT_EQ(s.bin_ns, 10 * kNsPerMs);
  EXPECT_NEAR(s.usual_rate, 10'000, 1e-9);
  EXPECT_EQ(s.gap_count + s.hot_count + s.bursts, 0);
}

TEST(EventSurvey, AGapAHotPixelAndABurstAreFound) {
  std::vector<std::pair<TimeNs, std::pair<int, int>>> events;
  for (int i = 0; i < 100'000; ++i) {
    const TimeNs t = 10 * i + (i >= 50'000 ? 75'000 : 0);  // 75 ms of silence in the middle
    events.push_back({t, {i % 100, (i / 100) % 100}});
    if (i % 100 == 0) events.push_back({t, {70, 33}});  // 1000 events where others have ten
  }
  const TimeNs at = events.back().first + 1;
  for (int i = 0; i < 20'000; ++i) events.push_back({at + i / 2, {i % 100, (i / 100) % 100}});
  const EventSummary s = survey(events);
  ASSERT_EQ(s.gap_count, 1);
  EXPECT_EQ(s.gaps[0].begin, 499'990 * kNsPerUs);
  EXPECT_EQ(s.gaps[0].end, 575'000 * kNsPerUs);
  ASSERT_EQ(s.hot_count, 1);
  EXPECT_EQ(s.hot[0].x, 70);
  EXPECT_EQ(s.hot[0].y, 33);
  EXPECT_EQ(s.hot[0].count, 1012);
  EXPECT_GE(s.bursts, 1);
  EXPECT_NEAR(to_seconds(s.loudest_at), to_seconds(at * kNsPerUs), 0.011);
}

TEST(EventSurvey, OfNothingThereIsNothingToSay) {
  const EventSummary s = EventSurvey().finish();
  EXPECT_EQ(s.count, 0);
  EXPECT_EQ(s.mean_rate(), 0);
}

/// Noise of known density at rest from `from_s` to `to_s`, a swing elsewhere.
std::vector<ImuSample> samples(double from_s, double to_s, double rate_hz = 400) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto noise = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  std::vector<ImuSample> out;
  for (int i = 0; i < 8 * static_cast<int>(rate_hz); ++i) {
    const double t = i / rate_hz;
    ImuSample s;
    s.t = from_seconds(t);
    s.gyro = Eigen::Vector3d(0.01, -0.02, 0.03) + 1e-3 * std::sqrt(rate_hz) * noise();
    s.accel = Eigen::Vector3d(0, 0, 9.81) + 2e-3 * std::sqrt(rate_hz) * noise();
    if (t < from_s || t > to_s) {
      s.gyro.x() += std::sin(7 * t);
      s.accel.y() += 3 * std::cos(7 * t);
    }
    out.push_back(s);
  }
  return out;
}

TEST(ImuSurvey, NoiseAndBiasAtRestAreThoseThatWerePutIn) {
  const ImuSummary s = survey_imu(samples(2, 6));
  EXPECT_EQ(s.count, 3200);
  EXPECT_NEAR(s.rate_hz(), 400, 1e-6);
  ASSERT_TRUE(s.at_rest.has_value());
  EXPECT_NEAR(to_seconds(s.at_rest->begin), 2, 0.3);
  EXPECT_NEAR(to_seconds(s.at_rest->end), 6, 0.3);
  EXPECT_LT((s.at_rest->gyro_bias - Eigen::Vector3d(0.01, -0.02, 0.03)).norm(), 2e-3);
  EXPECT_NEAR(s.at_rest->accel.norm(), 9.81, 5e-3);
  EXPECT_NEAR(s.at_rest->gyro_density, 1e-3, 5e-5);
  EXPECT_NEAR(s.at_rest->accel_density, 2e-3, 1e-4);
}

TEST(ImuSurvey, InFlightThereIsNoRest) { EXPECT_FALSE(survey_imu(samples(9, 9)).at_rest.has_value()); }

TEST(ImuSurvey, GapsAndStampsThatGoBackAreCounted) {
  auto all = samples(0, 8, 100);
  all.erase(all.begin() + 200, all.begin() + 230);  // 0.31 s without a sample
  all[400].t = all[399].t;
  const ImuSummary s = survey_imu(all);
  ASSERT_EQ(s.gap_count, 1);
  EXPECT_EQ(s.gaps[0].begin, from_seconds(1.99));
  EXPECT_EQ(s.gaps[0].end, from_seconds(2.30));
  EXPECT_EQ(s.not_forward, 1);
  EXPECT_NEAR(s.interval_s, 0.01, 1e-12);
}

}  // namespace
}  // namespace evpose
