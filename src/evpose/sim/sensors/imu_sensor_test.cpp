// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/imu_sensor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/config.h"
#include "evpose/imu/strapdown.h"

namespace evpose::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Trajectory rest() { return {PoseSpline(0.1, {Pose{}}), {}, 1}; }

Trajectory flight(TrajectoryKind kind) {
  TrajectoryConfig c;
  c.kind = kind;
  return make_trajectory(c).value();
}

ImuConfig ideal(double rate_hz) {
  ImuConfig c;
  c.preset = ImuPreset::ideal;
  c.rate_hz = rate_hz;
  return c;
}

/// Overlapping Allan deviation of all three axes, from the running integral of the readings.
double allan(const std::vector<ImuSample>& samples, Eigen::Vector3d ImuSample::*part, std::size_t span,
             double rate_hz) {
  std::vector<Eigen::Vector3d> integral(samples.size() + 1, Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < samples.size(); ++i)
    integral[i + 1] = integral[i] + (samples[i].*part - samples[0].*part) / rate_hz;
  double sum = 0;
  const std::size_t count = integral.size() - 2 * span;
  for (std::size_t i = 0; i < count; ++i)
    sum += (integral[i + 2 * span] - 2 * integral[i + span] + integral[i]).squaredNorm();
  const double tau = static_cast<double>(span) / rate_hz;
  return std::sqrt(sum / (6 * static_cast<double>(count) * tau * tau));
}

TEST(ImuSensor, AllanDeviationAtRestIsThatOfTheDensities) {
  for (const ImuPreset preset : {ImuPreset::pixhawk, ImuPreset::adis}) {
    const double rate_hz = 100;
    ImuConfig white;
    white.preset = preset;
    white.rate_hz = rate_hz;
    white.accel_resolution_m_s2 = white.gyro_resolution_deg_s = 0;
    const ImuNoise noise = imu_noise(white);
    ImuConfig walk = white;
    white.accel_walk = white.gyro_walk = 0;
    walk.accel_density = walk.gyro_density = 0;
    const auto white_samples = simulate_imu(rest(), 3000 * kNsPerS, white, 1);
    for (const std::size_t span : {std::size_t{1}, std::size_t{100}}) {
      const double root = std::sqrt(static_cast<double>(span) / rate_hz);
      EXPECT_NEAR(allan(white_samples, &ImuSample::gyro, span, rate_hz) * root / noise.gyro_density, 1, 0.05);
      EXPECT_NEAR(allan(white_samples, &ImuSample::accel, span, rate_hz) * root / noise.accel_density, 1,
                  0.05);
    }
    // K sqrt(tau / 3); the steps of the walk are small against tau.
    const auto walk_samples = simulate_imu(rest(), 3000 * kNsPerS, walk, 2);
    const double root = std::sqrt(2.0 / 3);
    EXPECT_NEAR(allan(walk_samples, &ImuSample::gyro, 200, rate_hz) / root / noise.gyro_walk, 1, 0.05);
    EXPECT_NEAR(allan(walk_samples, &ImuSample::accel, 200, rate_hz) / root / noise.accel_walk, 1, 0.05);
  }
}

TEST(ImuSensor, IdealReadsTheTruth) {
  const Trajectory trajectory = flight(TrajectoryKind::aggressive);
  const auto samples = simulate_imu(trajectory, 2 * kNsPerS, ideal(1000), 3);
  ASSERT_EQ(samples.size(), 2001u);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].t, static_cast<TimeNs>(i) * kNsPerMs);
    const BodyMotion m = trajectory.at(1e-3 * static_cast<double>(i));
    EXPECT_LT((samples[i].gyro - m.rate).norm(), 1e-12);
    EXPECT_LT((m.T_map_body.q * samples[i].accel + gravity_map() - m.acceleration).norm(), 1e-9);
  }
}

TEST(ImuSensor, StrapdownOfTheIdealImuFollowsASpiral) {
  const Trajectory trajectory = flight(TrajectoryKind::square_spiral);
  const auto samples = simulate_imu(trajectory, 10 * kNsPerS, ideal(1000), 3);
  const BodyMotion start = trajectory.at(0), end = trajectory.at(10);
  NavState state{start.T_map_body, start.velocity};
  for (std::size_t i = 1; i < samples.size(); ++i)
    state = strapdown(state, samples[i - 1], samples[i], Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                      gravity_map());
  // The mid-point rule's own error at 1 kHz; trajectory_test.cpp holds the trajectory to a finer one.
  EXPECT_LT((state.T_map_body.p - end.T_map_body.p).norm(), 5e-4);
}

TEST(ImuSensor, ReadingsAreMatrixTimesTruthPlusBias) {
  const Trajectory trajectory = flight(TrajectoryKind::lissajous);
  ImuConfig c = ideal(200);
  c.accel_scale = 0.02, c.gyro_scale = 0.03, c.accel_misalignment_deg = 1, c.gyro_misalignment_deg = 2;
  c.accel_bias = 0.1, c.gyro_bias = 0.01;
  const ImuErrors errors = draw_imu_errors(c, 7);
  EXPECT_GT((errors.gyro_matrix - Eigen::Matrix3d::Identity()).norm(), 0.02);
  EXPECT_GT(errors.accel_bias.norm(), 0.01);
  for (const ImuSample& s : simulate_imu(trajectory, kNsPerS, c, 7)) {
    const ImuSample truth = ideal_imu(trajectory.at(to_seconds(s.t)), s.t);
    EXPECT_LT((s.gyro - errors.gyro_matrix * truth.gyro - errors.gyro_bias).norm(), 1e-10);
    EXPECT_LT((s.accel - errors.accel_matrix * truth.accel - errors.accel_bias).norm(), 1e-10);
  }
}

TEST(ImuSensor, ErrorsSpreadAsConfigured) {
  ImuConfig c = ideal(200);
  c.gyro_scale = 0.03, c.gyro_misalignment_deg = 2, c.gyro_bias = 0.01;
  double scale = 0, misalignment = 0, bias = 0;
  constexpr int kCount = 2000;
  for (std::uint64_t seed = 0; seed < kCount; ++seed) {
    const ImuErrors f = draw_imu_errors(c, seed);
    EXPECT_EQ(f.accel_matrix, Eigen::Matrix3d::Identity());
    const Eigen::Matrix3d off = f.gyro_matrix - Eigen::Matrix3d::Identity();
    scale += off.diagonal().squaredNorm() / (3 * kCount);
    misalignment += (off.squaredNorm() - off.diagonal().squaredNorm()) / (6 * kCount);
    bias += f.gyro_bias.squaredNorm() / (3 * kCount);
  }
  EXPECT_NEAR(std::sqrt(scale), 0.03, 0.001);
  EXPECT_NEAR(std::sqrt(misalignment), 2 * kDegree, 0.001);
  EXPECT_NEAR(std::sqrt(bias), 0.01, 0.0004);
}

TEST(ImuSensor, ReadingsSaturateAtTheRange) {
  const Trajectory trajectory = flight(TrajectoryKind::aggressive);
  ImuConfig c = ideal(500);
  c.accel_range_m_s2 = 9.9;
  c.gyro_range_deg_s = 20;
  int full = 0;
  for (const ImuSample& s : simulate_imu(trajectory, 4 * kNsPerS, c, 1)) {
    const ImuSample truth = ideal_imu(trajectory.at(to_seconds(s.t)), s.t);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(s.gyro[axis], std::clamp(truth.gyro[axis], -20 * kDegree, 20 * kDegree), 1e-10);
      EXPECT_NEAR(s.accel[axis], std::clamp(truth.accel[axis], -9.9, 9.9), 1e-10);
      full += std::abs(truth.gyro[axis]) > 20 * kDegree;
    }
  }
  EXPECT_GT(full, 100);
}

TEST(ImuSensor, ReadingsAreWholeSteps) {
  ImuConfig c = ideal(100);
  c.gyro_density = 1e-3, c.gyro_resolution_deg_s = 0.5, c.accel_density = 0.01,
  c.accel_resolution_m_s2 = 0.25;
  for (const ImuSample& s : simulate_imu(rest(), kNsPerS, c, 1))
    for (int axis = 0; axis < 3; ++axis) {
      const double gyro = s.gyro[axis] / (0.5 * kDegree), accel = s.accel[axis] / 0.25;
      EXPECT_NEAR(gyro, std::round(gyro), 1e-9);
      EXPECT_NEAR(accel, std::round(accel), 1e-9);
    }
}

TEST(ImuSensor, OffsetStampIsLateByTheOffset) {
  const Trajectory trajectory = flight(TrajectoryKind::square_spiral);
  ImuConfig c = ideal(200);
  c.time_offset_s = 0.004;
  for (const ImuSample& s : simulate_imu(trajectory, kNsPerS, c, 1))
    EXPECT_LT((s.gyro - trajectory.at(to_seconds(s.t) - 0.004).rate).norm(), 1e-12);
}

TEST(ImuSensor, JitterOfTheStampsIsAsGivenAndKeepsTheirOrder) {
  ImuConfig c = ideal(1000);
  c.jitter_us = 40;
  double sum = 0, squares = 0;
  const auto samples = simulate_imu(rest(), 20 * kNsPerS, c, 1);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double shift_us = 1e-3 * static_cast<double>(samples[i].t - static_cast<TimeNs>(i) * kNsPerMs);
    sum += shift_us;
    squares += shift_us * shift_us;
  }
  const auto count = static_cast<double>(samples.size());
  EXPECT_NEAR(sum / count, 0, 4 * 40 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count), 40, 40 * 4 / std::sqrt(2 * count));
  c.jitter_us = 5000;  // more than the interval: cut
  const auto wild = simulate_imu(rest(), kNsPerS, c, 1);
  for (std::size_t i = 1; i < wild.size(); ++i) EXPECT_GT(wild[i].t, wild[i - 1].t);
}

TEST(ImuSensor, VibrationLineHasItsFrequencyAndAmplitudePerAxis) {
  ImuConfig c = ideal(1000);
  c.lines[1].frequency_hz = 83;
  c.lines[1].accel_m_s2 = {1, 2, 3};
  c.lines[1].gyro_deg_s = {0, 5, 0};
  const auto samples = simulate_imu(rest(), 10 * kNsPerS - 1, c, 1);
  const auto amplitude = [&](Eigen::Vector3d ImuSample::*part, int axis) {
    double in_phase = 0, quadrature = 0;
    for (const ImuSample& s : samples) {
      const double angle = 2 * std::numbers::pi * 83 * to_seconds(s.t);
      in_phase += (s.*part)[axis] * std::cos(angle);
      quadrature += (s.*part)[axis] * std::sin(angle);
    }
    return 2 * std::hypot(in_phase, quadrature) / static_cast<double>(samples.size());
  };
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(amplitude(&ImuSample::accel, axis), 1 + axis, 1e-6);
    EXPECT_NEAR(amplitude(&ImuSample::gyro, axis), axis == 1 ? 5 * kDegree : 0, 1e-6);
  }
}

TEST(ImuSensor, OverridesStandAndTheRestIsThePresets) {
  ImuConfig c;
  ConfigTable table;
  table.group("imu", c);
  ASSERT_TRUE(table.set("imu.preset", "adis", "test"));
  ASSERT_TRUE(table.set("imu.gyro_density", "0.5", "test"));
  ASSERT_TRUE(table.set("imu.line_2.gyro_y_deg_s", "3", "test"));
  EXPECT_FALSE(table.set("imu.rate_hz", "0", "test"));
  const ImuConfig r = with_preset_values(c);
  EXPECT_EQ(r.gyro_density, 0.5);
  EXPECT_EQ(r.gyro_range_deg_s, 1000);
  EXPECT_EQ(r.lines[1].gyro_deg_s[1], 3);
  EXPECT_EQ(imu_noise(c).gyro_density, 0.5);
  EXPECT_GT(imu_noise(ideal(200)).accel_density, 0);
}

TEST(ImuSensor, SameSeedSameReadingsAndASettingLeavesOthersAlone) {
  ImuConfig c;
  const auto one = simulate_imu(rest(), kNsPerS, c, 5), same = simulate_imu(rest(), kNsPerS, c, 5);
  c.accel_density = 0.1;
  const auto other = simulate_imu(rest(), kNsPerS, c, 5);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].accel, same[i].accel);
    EXPECT_EQ(one[i].t, other[i].t);
    EXPECT_EQ(one[i].gyro, other[i].gyro);
  }
  EXPECT_NE(one[7].accel, other[7].accel);
}

}  // namespace
}  // namespace evpose::sim
