// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/tracked_run.h"

#include <gtest/gtest.h>

namespace evpose::map_learn {
namespace {

/// Along x at 1 m/s, turning about z at 0.5 rad/s, a row each 10 ms.
RunFiles turning_run(std::size_t rows) {
  RunFiles run;
  for (std::size_t i = 0; i < rows; ++i) {
    RunRow row;
    row.t = kNsPerS + static_cast<TimeNs>(i) * 10 * kNsPerMs;
    row.T_map_body.p.x() = 0.01 * static_cast<double>(i);
    row.T_map_body.q = so3::exp({0, 0, 0.005 * static_cast<double>(i)});
    row.velocity.x() = 1;
    row.gyro_bias.y() = 0.02;
    row.covariance.diagonal().setConstant(1e-6);
    row.health = Health::tracking;
    run.rows.push_back(row);
  }
  return run;
}

TEST(TrackedRun, ItsStatesStandWhereATrackerMakesItsUpdates) {
  const Trajectory states = states_of(turning_run(51), 300);
  ASSERT_EQ(states.size(), 151u);
  for (std::size_t k = 0; k < states.size(); ++k) {
    EXPECT_EQ(states[k].t, kNsPerS + from_seconds(static_cast<double>(k) / 300));
    EXPECT_NEAR(states[k].nav.T_map_body.p.x(), static_cast<double>(k) / 300, 1e-6);
    EXPECT_NEAR(states[k].angular_rate.z(), 0.5, 1e-6);
    EXPECT_EQ(states[k].gyro_bias.y(), 0.02);
    EXPECT_EQ(states[k].covariance(2, 2), 1e-6);
  }
}

TEST(TrackedRun, ItBeginsWithTheFirstPoseThatTheRunStandsBy) {
  RunFiles run = turning_run(20);
  for (std::size_t i = 0; i < 5; ++i) run.rows[i].health = Health::waiting;
  EXPECT_EQ(states_of(run, 100).front().t, run.rows[5].t);
  EXPECT_EQ(states_of(run, 100).size(), 15u);
  EXPECT_NEAR(tracking_share(run), 0.75, 1e-9);
}

TEST(TrackedRun, TheRequestStartsThereAndTakesTheCalibrationOfTheRun) {
  RunFiles run = turning_run(3);
  run.input.calibration = "of_the_run.yaml";
  const FusionState start = states_of(run, 100).front();
  EXPECT_EQ(request_of({}, run, start).init, "0,0,0,0,0,0,1@1");
  EXPECT_EQ(request_of({}, run, start).calibration, "of_the_run.yaml");
  TrackRequest named;
  named.calibration = "named.yaml";
  EXPECT_EQ(request_of(named, run, start).calibration, "named.yaml");
}

}  // namespace
}  // namespace evpose::map_learn
