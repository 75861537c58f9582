// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/lidar_faults.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <tuple>

#include "evpose/sim/sensors/lidar.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

using Eigen::Vector3d;

// Straight on at 1 m/s.
Trajectory straight(double duration_s) {
  std::vector<Pose> knots;
  for (int i = -8; i < static_cast<int>(duration_s / 0.1) + 16; ++i)
    knots.push_back({Eigen::Quaterniond::Identity(), {0.1 * i, 0, 0}});
  return {PoseSpline(0.1, knots), {}, duration_s};
}

TEST(RegistrationDrift, GrowsAsTheRootOfTheWay) {
  const Trajectory trajectory = straight(20);
  const double way_m = (trajectory.at(20).T_map_body.p - trajectory.at(0).T_map_body.p).norm();
  LidarConfig config;
  config.registration_drift_mm_per_10m = 5;
  constexpr int kSeeds = 600;
  double half = 0, whole = 0, turn = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto drift = registration_drift(trajectory, config, static_cast<std::uint64_t>(seed));
    ASSERT_EQ(drift.size(), 200u);
    half += drift[99].p.squaredNorm() / 3;
    whole += drift[199].p.squaredNorm() / 3;
    turn += so3::log(drift[199].q).squaredNorm() / 3;
  }
  const double expected = 25e-6 * way_m / 10, tolerance = 4 * std::sqrt(2.0 / (3 * kSeeds));
  EXPECT_NEAR(whole / kSeeds / expected, 1, tolerance);
  EXPECT_NEAR(half / whole, 0.5, 1.5 * tolerance);
  EXPECT_NEAR(turn / kSeeds / (expected / 100), 1, tolerance);
}

TEST(RegistrationDrift, IsSmoothAndNoneWithoutMotion) {
  LidarConfig config;
  config.registration_drift_mm_per_10m = 5;
  const auto drift = registration_drift(straight(20), config, 3);
  for (std::size_t i = 1; i < drift.size(); ++i)  // 0.5 mm a scan, 1 sigma of each axis
    EXPECT_LT((drift[i].p - drift[i - 1].p).norm(), 3e-3);
  const Trajectory standing(PoseSpline(0.1, {Pose()}), {}, 2);
  for (const Pose& pose : registration_drift(standing, config, 3)) EXPECT_EQ(pose.p.norm(), 0);
}

std::vector<CloudPoint> floor_cloud(int count) {
  Random random(5);
  std::vector<CloudPoint> cloud;
  for (int i = 0; i < count; ++i) {
    const double x = random.uniform(0, 8), y = random.uniform(0, 6);
    cloud.push_back({Vector3d(x, y, 0).cast<float>(), 100, 0});
  }
  return cloud;
}

std::set<std::pair<int, int>> cells(const std::vector<CloudPoint>& cloud) {
  std::set<std::pair<int, int>> all;
  for (const CloudPoint& p : cloud)
    all.emplace(static_cast<int>(std::floor(static_cast<double>(p.position.x()) / 0.1)),
                static_cast<int>(std::floor(static_cast<double>(p.position.y()) / 0.1)));
  return all;
}

TEST(MissingParts, LeaveOutTheGivenFractionInCoherentParts) {
  const auto all = floor_cloud(200000);
  const double before = static_cast<double>(cells(all).size());
  for (const double fraction : {0.05, 0.2, 0.6}) {
    auto cloud = all;
    leave_out_parts(fraction, 7, cloud);
    const auto left = cells(cloud);
    EXPECT_NEAR(1 - static_cast<double>(left.size()) / before, fraction, 1 / before);
    // A cell that is left rarely borders one that is not: holes of 0.3 m have a rim of a third of their area.
    const auto whole = cells(all);
    double rim = 0;
    for (const auto& [x, y] : left)
      for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
        rim += whole.contains({x + dx, y + dy}) && !left.contains({x + dx, y + dy});
    EXPECT_GT(rim, 0);
    EXPECT_LT(rim, 0.7 * fraction * before);
  }
}

TEST(MissingParts, DependOnTheSeedAlone) {
  const auto all = floor_cloud(50000);
  auto a = all, b = all, c = all, none = all;
  leave_out_parts(0.3, 1, a);
  leave_out_parts(0.3, 1, b);
  leave_out_parts(0.3, 2, c);
  leave_out_parts(0, 1, none);
  EXPECT_EQ(cells(a), cells(b));
  EXPECT_NE(cells(a), cells(c));
  EXPECT_EQ(none.size(), all.size());
}

}  // namespace
}  // namespace evpose::sim
