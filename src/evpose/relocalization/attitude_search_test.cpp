// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/attitude_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evpose/relocalization/test_room.h"

namespace evpose {
namespace {

using test_room::camera_on_body;

constexpr double kNear_rad = 0.035;  // from where places are found and refined

double nearest(const std::vector<AttitudeGuess>& guesses, const Eigen::Quaterniond& truth) {
  double out = 4;
  for (const AttitudeGuess& g : guesses) out = std::min(out, g.q_map_body.angularDistance(truth));
  return out;
}

TEST(MainDirections, AreTheAxesOfARoomWhereverItPointsTo) {
  auto edges = test_room::room();
  const Eigen::Quaterniond turn = so3::exp({0.3, -0.5, 0.9});
  for (auto& edge : edges)
    for (Eigen::Vector3d& end : edge) end = turn * end;
  const std::vector<MapDirection> found = main_directions(test_room::map_of(edges));
  ASSERT_EQ(found.size(), 3U);
  double shares = 0;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = turn * Eigen::Vector3d::Unit(k);
    EXPECT_TRUE(std::any_of(found.begin(), found.end(), [&](const MapDirection& d) {
      return std::abs(d.axis.dot(axis)) > std::cos(2e-3);
    })) << k;
    shares += found[static_cast<std::size_t>(k)].share;
  }
  EXPECT_NEAR(shares, 1, 1e-6);
}

class AttitudeSearch : public ::testing::Test {
 protected:
  AttitudeSearch() : camera_(test_room::make_room_camera()), edges_(test_room::room()) {}
  std::vector<AttitudeGuess> search(const Pose& T_map_body, const AttitudePrior& prior) const {
    const auto lines = test_room::seen_lines(edges_, *camera_, T_map_body * camera_on_body(), 0.5, 7);
    return search_attitude(lines, *camera_, camera_on_body().q, directions_, prior, 16);
  }
  static Pose pose(double heading, double roll, double pitch) {
    return {so3::exp({0, 0, heading}) * so3::exp({roll, pitch, 0}), {3, 2.5, 1.4}};
  }

  std::shared_ptr<const Camera> camera_;
  std::vector<test_room::Segment> edges_;
  std::vector<MapDirection> directions_ = main_directions(test_room::map_of(edges_));
};

TEST_F(AttitudeSearch, FindsTheAttitudeToTwoDegreesAlthoughTheAccelerometerIsTwelveOff) {
  for (const double heading : {0.2, 1.4, 2.9, -2.0}) {
    const Pose truth = pose(heading, 0.1, -0.15);
    AttitudePrior prior{so3::exp({0.15, -0.15, 0}) * (truth.q.conjugate() * Eigen::Vector3d::UnitZ())};
    EXPECT_LT(nearest(search(truth, prior), truth.q), kNear_rad) << heading;
  }
}

TEST_F(AttitudeSearch, OfTheFourHeadingsOfARoomAKnownOneLeavesOne) {
  const Pose truth = pose(0.2, 0.05, 0.1);
  AttitudePrior prior{truth.q.conjugate() * Eigen::Vector3d::UnitZ()};
  for (const double turn : {0.0, 0.5, 1.0, 1.5})
    EXPECT_LT(nearest(search(truth, prior), so3::exp({0, 0, turn * M_PI}) * truth.q), kNear_rad) << turn;
  prior.heading_from = so3::exp({0, 0, 0.4}) * truth.q;
  prior.heading_within = 0.9;
  const auto found = search(truth, prior);
  EXPECT_LT(nearest(found, truth.q), kNear_rad);
  EXPECT_GT(nearest(found, so3::exp({0, 0, M_PI / 2}) * truth.q), 0.3);
}

TEST_F(AttitudeSearch, WithoutLinesOrDirectionsThereIsNone) {
  const AttitudePrior prior{Eigen::Vector3d::UnitZ()};
  EXPECT_TRUE(search_attitude({}, *camera_, camera_on_body().q, directions_, prior, 16).empty());
  const auto lines = test_room::seen_lines(edges_, *camera_, pose(0, 0, 0) * camera_on_body(), 1, 7);
  EXPECT_TRUE(search_attitude(lines, *camera_, camera_on_body().q, {}, prior, 16).empty());
}

}  // namespace
}  // namespace evpose
