// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/flight/flight_check.h"

#include <gtest/gtest.h>

#include "evpose/sim/light/test_scene.h"

namespace evpose::sim {
namespace {

// Along a wall and, if it stands there, through a pane.
TEST(FlightCheck, RefusesAFlightThroughAPane) {
  TestScene test;
  test.add({5, -5, -5}, {0, 0, 10}, {0, 10, 0}, 0.5);
  const CameraPath path = [](double t_s) {
    return CameraMotion{looking_along_x({0, 2 * t_s - 1, 0}), {-2, 0, 0}, {0, 0, 0}};
  };
  EXPECT_TRUE(check_flight(RayCaster(test.scene), path, 1, 300, 1e4).ok());
  test.scene.panes = {{{-1, 0.2, -1}, {2, 0, 0}, {0, 0, 2}}};
  const Status refused = check_flight(RayCaster(test.scene), path, 1, 300, 1e6);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().line().find("mm to something"), std::string::npos) << refused.error().line();
  test.scene.panes = {{{-1, 2, -1}, {2, 0, 0}, {0, 0, 2}}};
  EXPECT_TRUE(check_flight(RayCaster(test.scene), path, 1, 300, 1e4).ok());
}

}  // namespace
}  // namespace evpose::sim
