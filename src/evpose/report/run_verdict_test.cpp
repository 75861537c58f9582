// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/run_verdict.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace evpose {
namespace {

struct Stretch {
  double s;  ///< how long
  Health health;
  const char* reason;
};

/// A run of these stretches with 100 updates a second.
StateLog log_of(const std::vector<Stretch>& stretches) {
  StateLog log;
  Update u;
  for (const Stretch& stretch : stretches) {
    u.health = stretch.health;
    u.reason = stretch.reason;
    for (int i = 0; i < std::lround(100 * stretch.s); ++i) {
      log.add(u);
      u.t += 10 * kNsPerMs;
      u.reason.clear();
    }
  }
  return log;
}

TEST(RunVerdict, ShareIsThatOfTheUpdatesButForTheFirstTenth) {
  EXPECT_EQ(judge_run({}).tracking_share, 0);
  EXPECT_FALSE(judge_run({}).good());
  EXPECT_EQ(judge_run(log_of({{0.1, Health::initialising, ""}, {0.2, Health::tracking, ""}})).tracking_share,
            1);
  // A start that goes on is no start.
  EXPECT_NEAR(
      judge_run(log_of({{0.6, Health::initialising, ""}, {0.5, Health::tracking, ""}})).tracking_share, 0.5,
      1e-12);
  const auto with_loss = [](double lost_s) {
    return judge_run(log_of({{10 - lost_s, Health::tracking, ""}, {lost_s, Health::lost, "because"}}));
  };
  EXPECT_TRUE(with_loss(1).good());
  EXPECT_FALSE(with_loss(1.01).good());
}

TEST(RunVerdict, ProblemsAreOneForEachCauseTheLongestFirst) {
  const RunVerdict v =
      judge_run(log_of({{1, Health::tracking, "a"},
                        {0.5, Health::degraded, "events do not gather at the contours"},
                        {1, Health::tracking, "b"},
                        {2, Health::degraded, "IMU contradicts the camera"},
                        {1, Health::tracking, "c"},
                        {0.8, Health::lost, "no registration for 0.1 s: events do not gather"},
                        {1, Health::tracking, "d"}}));
  ASSERT_EQ(v.problems.size(), 2u);
  EXPECT_EQ(v.problems[0].reason, "IMU contradicts the camera");
  EXPECT_NEAR(v.problems[0].total_s, 2, 1e-9);
  EXPECT_EQ(v.problems[0].last, 2500 * kNsPerMs);
  EXPECT_EQ(v.problems[1].health, Health::lost);
  EXPECT_NEAR(v.problems[1].total_s, 1.3, 1e-9);
  EXPECT_EQ(v.problems[1].last, 5500 * kNsPerMs);
  EXPECT_NEAR(v.length_s, 7.29, 1e-9);
}

TEST(RunVerdict, ASearchComesAfterWhatItFollowsFrom) {
  const RunVerdict v = judge_run(log_of({{1, Health::tracking, "a"},
                                         {0.5, Health::degraded, "events do not gather at the contours"},
                                         {3, Health::lost, "searching for the pose"}}));
  ASSERT_EQ(v.problems.size(), 2u);
  EXPECT_EQ(v.problems[1].reason, "searching for the pose");
}

TEST(RunVerdict, EveryReasonOfTheTrackerHasACauseOfItsOwnAndARemedy) {
  std::set<std::string> causes;
  const std::vector<std::string> reasons{
      "events do not gather at the contours",
      "pose in doubt: contours and events agree no better than at wrong poses",
      "IMU contradicts the camera",
      "no registration for 0.1 s: no map point in view",
      "only 3 of 200 map points have events near by",
      "no registration for 0.1 s: registration contradicts the prediction",
      "searching for the pose",
      "IMU saturated: gyroscope z",
      "IMU gap of 12.5 ms",
      "no IMU samples",
      "IMU stuck: accelerometer x",
      "more events than are taken (events.most_mev_s)",
      "the time offset has changed",
      "collecting events",
      "pose uncertain by 12 px, beyond the limit of 8 px: position along (1, 0, 0) of the map",
      "a reason that nobody knows"};
  for (const std::string& reason : reasons) {
    const Error why = explain_reason(reason);
    EXPECT_FALSE(why.fix.empty()) << reason;
    EXPECT_TRUE(causes.insert(why.what).second) << reason;
  }
  // The reason inside of a general one is the one that is explained.
  EXPECT_EQ(explain_reason("pose uncertain by 12 px, beyond the limit of 8 px: no map point in view").what,
            explain_reason("no map point in view").what);
}

TEST(RunVerdict, NumbersOfAReasonAreShort) {
  const auto v = judge_run(
      log_of({{1, Health::lost, "uncertain by 12.015317851 px, along (0.953, 0, -1.5), 1e-05 of x.123456"}}));
  EXPECT_EQ(v.problems[0].reason, "uncertain by 12.01 px, along (0.95, 0, -1.5), 1e-05 of x.123456");
}

TEST(RunVerdict, TextNamesWhatLastedAndInABadRunTheFindings) {
  const std::vector<Error> findings{{"start", "lies 3.1 m outside of the map's bounds", "check --init"}};
  const auto text_of = [&](double lost_s) {
    return verdict_text(judge_run(log_of({{10 - lost_s, Health::tracking, ""},
                                          {lost_s, Health::lost, "no map point in view"}})),
                        findings);
  };
  const std::string bad = text_of(5), fair = text_of(0.5), good = text_of(0.05);
  for (const char* words : {"tracking in 50.0 %", "less than 90 %", "lies 3.1 m outside",
                            "no map point in view", "likely: ", "do: ", "lost for 4.99 s, last at 5.000 s"})
    EXPECT_NE(bad.find(words), std::string::npos) << words << " in\n" << bad;
  EXPECT_EQ(fair.find("3.1 m"), std::string::npos);
  EXPECT_NE(fair.find("no map point in view"), std::string::npos);
  EXPECT_EQ(good, "tracking in 99.5 % of the updates");
}

}  // namespace
}  // namespace evpose
