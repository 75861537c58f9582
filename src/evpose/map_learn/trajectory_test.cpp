// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/trajectory.h"

#include <gtest/gtest.h>

namespace evpose::map_learn {
namespace {

Trajectory straight_flight() {
  Trajectory out(11);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].t = static_cast<TimeNs>(i) * 10 * kNsPerMs;
    out[i].nav.velocity = {1, 0, 0};
    out[i].nav.T_map_body.p = {0.01 * static_cast<double>(i), 0, 0};
  }
  return out;
}

TEST(Trajectory, BetweenTwoStatesThePoseIsInBetween) {
  const Trajectory flight = straight_flight();
  EXPECT_NEAR(state_at(flight, 25 * kNsPerMs).nav.T_map_body.p.x(), 0.025, 1e-12);
  EXPECT_EQ(state_at(flight, 30 * kNsPerMs).t, flight[3].t);
  EXPECT_EQ(state_at(flight, -1).t, flight.front().t);
  EXPECT_EQ(state_at(flight, 1000 * kNsPerMs).t, flight.back().t);
}

TEST(Trajectory, ErrorsAreLinearBetweenKnotsAndStayBeyondTheLast) {
  Trajectory flight = straight_flight();
  Vector15d first = Vector15d::Zero(), last = first;
  first(1) = 1e-3;
  last(1) = 3e-3;
  last(5) = 0.02;
  add_at_knots({0, 8}, {first, last}, flight);
  EXPECT_NEAR(flight[0].nav.T_map_body.p.y(), 1e-3, 1e-12);
  EXPECT_NEAR(flight[4].nav.T_map_body.p.y(), 2e-3, 1e-12);
  EXPECT_NEAR(flight[8].nav.T_map_body.p.y(), 3e-3, 1e-12);
  EXPECT_NEAR(flight[10].nav.T_map_body.p.y(), 3e-3, 1e-12);
  EXPECT_NEAR(so3::log(flight[4].nav.T_map_body.q).z(), 0.01, 1e-9);
}

}  // namespace
}  // namespace evpose::map_learn
