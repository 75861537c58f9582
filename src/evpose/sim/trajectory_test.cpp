// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/trajectory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/imu/strapdown.h"
#include "evpose/sim/imu_sensor.h"
#include "evpose/sim/scene.h"

namespace evpose::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Trajectory wild() {
  return Trajectory({{{1, {{0.5, 0.1, 2, 0.3}}},
                      {-2, {{0.3, 0, 3, 1}, {0.1, -0.05, 7, 2}}},
                      {0.5, {{0.2, 0.2, 1, 0}}},
                      {0.4, {{1.2, 0, 1.3, 0.2}}},
                      {-0.2, {{0.7, 0.1, 2.1, 1.1}}},
                      {0.1, {{0.9, 0, 1.7, 2.2}}}}});
}

TEST(Trajectory, DerivativesMatchDifferences) {
  for (const Trajectory& trajectory : {wild(), make_square_spiral(1)}) {
    const double h = 1e-5;
    for (double t = 0; t < 3; t += 0.0371) {
      const Motion now = trajectory.at(t), before = trajectory.at(t - h), after = trajectory.at(t + h);
      const Eigen::Vector3d velocity = (after.T_map_body.p - before.T_map_body.p) / (2 * h);
      const Eigen::Vector3d acceleration = (after.velocity - before.velocity) / (2 * h);
      const Eigen::Vector3d rate = so3::log(before.T_map_body.q.conjugate() * after.T_map_body.q) / (2 * h);
      EXPECT_LT((velocity - now.velocity).norm(), 1e-7);
      EXPECT_LT((acceleration - now.acceleration).norm(), 1e-7);
      EXPECT_LT((rate - now.rate).norm(), 1e-7);
    }
  }
}

TEST(Trajectory, SquareSpiralIsGentleAndStaysInFreeSpace) {
  const Scene scene = make_box_room(1);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Trajectory trajectory = make_square_spiral(seed);
    double speed = 0, fastest = 0, turn = 0;
    for (int i = 0; i < 3000; ++i) {
      const Motion m = trajectory.at(i * 1e-3);
      speed += m.velocity.norm() / 3000;
      fastest = std::max(fastest, m.velocity.norm());
      turn = std::max(turn, m.rate.norm());
    }
    EXPECT_GT(speed, 0.45);
    EXPECT_LT(speed, 0.8);
    EXPECT_LT(fastest, 1.1);
    EXPECT_GT(turn, 8 * kDegree);
    EXPECT_LT(turn, 25 * kDegree);
    for (double t = 0; t < 10; t += 0.05) {
      const Motion m = trajectory.at(t);
      for (const double azimuth : {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}) {
        const Eigen::Vector3d around(std::cos(azimuth), std::sin(azimuth), 0);
        EXPECT_FALSE(scene.solid(m.T_map_body.p + 0.3 * around)) << seed << " " << t;
      }
    }
  }
}

TEST(ImuSensor, StrapdownOfTheFaultlessImuReproducesTheTrajectory) {
  const Trajectory trajectory = make_square_spiral(1);
  const TimeNs step = kNsPerMs;
  const Motion start = trajectory.at(0);
  NavState state{start.T_map_body, start.velocity};
  ImuSample before = ideal_imu(start, 0);
  for (TimeNs t = step; t <= 2 * kNsPerS; t += step) {
    const ImuSample now = ideal_imu(trajectory.at(to_seconds(t)), t);
    state = strapdown(state, before, now, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), gravity_map());
    before = now;
  }
  const Motion end = trajectory.at(2);
  EXPECT_LT((state.T_map_body.p - end.T_map_body.p).norm(), 1e-4);
  EXPECT_LT((state.velocity - end.velocity).norm(), 1e-4);
  EXPECT_LT(so3::log(state.T_map_body.q.conjugate() * end.T_map_body.q).norm(), 1e-6);
}

TEST(ImuSensor, NoiseHasTheDensitiesAndWalksOfTheModel) {
  const Trajectory rest({});
  ImuNoise noise;
  noise.rate_hz = 1000;
  noise.gyro_walk = 1e-3;
  noise.accel_walk = 1e-2;
  const auto samples = simulate_imu(rest, 200 * kNsPerS, noise, {}, 1);
  ASSERT_EQ(samples.size(), 200001u);
  // Differences of neighbours: twice the variance of the white noise. Means of 1 s, 1 s apart: the walk's
  // variance times 2/3 s, and twice that of the noise's mean.
  const auto check = [&](auto part, double density, double walk) {
    double neighbours = 0, means = 0;
    for (std::size_t i = 1; i < samples.size(); ++i)
      neighbours += (part(samples[i]) - part(samples[i - 1])).squaredNorm();
    const double sigma = density * std::sqrt(1000);
    EXPECT_NEAR(std::sqrt(neighbours / (6.0 * 200000)), sigma, 0.02 * sigma);
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    for (int s = 0; s < 200; ++s) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (int i = 0; i < 1000; ++i) mean += part(samples[1000 * s + i]) / 1000;
      if (s > 0) means += (mean - last).squaredNorm() / (3 * 199);
      last = mean;
    }
    const double expected = walk * walk * 2 / 3 + 2 * density * density;
    EXPECT_NEAR(means, expected, 0.2 * expected);
  };
  check([](const ImuSample& s) { return s.gyro; }, noise.gyro_density, noise.gyro_walk);
  check([](const ImuSample& s) { return s.accel; }, noise.accel_density, noise.accel_walk);
  EXPECT_LT((samples[0].accel - Eigen::Vector3d(0, 0, 9.81)).norm(), 0.5);
}

}  // namespace
}  // namespace evpose::sim
