// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/preintegration.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <vector>

namespace evpose {
namespace {

using namespace error_state;

const Eigen::Vector3d kGravity(0, 0, -9.81);

/// A flight known in closed form: position on a Lissajous curve, attitude Rz(yaw) Rx(roll).
struct Flight {
  static FusionState state(double t) {
    FusionState s;
    s.nav.T_map_body.p = {0.8 * std::sin(1.3 * t), 0.6 * std::sin(1.7 * t + 0.4), 0.2 * std::sin(2 * t)};
    s.nav.velocity = {1.04 * std::cos(1.3 * t), 1.02 * std::cos(1.7 * t + 0.4), 0.4 * std::cos(2 * t)};
    s.nav.T_map_body.q = so3::exp({0, 0, yaw(t)}) * so3::exp({roll(t), 0, 0});
    return s;
  }
  static double yaw(double t) { return 0.5 * std::sin(0.9 * t); }
  static double roll(double t) { return 0.2 * std::sin(1.5 * t); }
  static ImuSample sample(TimeNs at) {
    const double t = to_seconds(at);
    const Eigen::Vector3d a(-1.352 * std::sin(1.3 * t), -1.734 * std::sin(1.7 * t + 0.4),
                            -0.8 * std::sin(2 * t));
    const Eigen::Vector3d yaw_rate(0, 0, 0.45 * std::cos(0.9 * t)), roll_rate(0.3 * std::cos(1.5 * t), 0, 0);
    return {at, so3::exp({-roll(t), 0, 0}) * yaw_rate + roll_rate,
            state(t).nav.T_map_body.q.conjugate() * (a - kGravity)};
  }
};

Preintegration integrate_flight(const std::vector<TimeNs>& times, const Eigen::Vector3d& bg = {0, 0, 0},
                                const Eigen::Vector3d& ba = {0, 0, 0}) {
  Preintegration sum(bg, ba);
  for (std::size_t i = 1; i < times.size(); ++i)
    sum.add(Flight::sample(times[i - 1]), Flight::sample(times[i]), ImuNoise{});
  return sum;
}

std::vector<TimeNs> every(TimeNs step, TimeNs end) {
  std::vector<TimeNs> out;
  for (TimeNs t = 0; t <= end; t += step) out.push_back(t);
  return out;
}

TEST(Preintegration, FollowsAFlightToAMicrometreInASecondAtOneKilohertz) {
  const Preintegration sum = integrate_flight(every(kNsPerMs, kNsPerS));
  const FusionState end = sum.predict(Flight::state(0), kGravity), truth = Flight::state(1);
  EXPECT_LT((end.nav.T_map_body.p - truth.nav.T_map_body.p).norm(), 1e-6);
  EXPECT_LT(end.nav.T_map_body.q.angularDistance(truth.nav.T_map_body.q), 1e-6);
  EXPECT_LT((end.nav.velocity - truth.nav.velocity).norm(), 2e-6);
}

TEST(Preintegration, IrregularSamplesRepeatsAndAGapAreNamedAndHarmless) {
  std::mt19937 random(3);
  std::vector<TimeNs> times{0};
  while (times.back() < kNsPerS)
    times.push_back(
        std::min<TimeNs>(kNsPerS, times.back() + 500'000 + static_cast<TimeNs>(random() % 1'500'000)));
  times.insert(times.begin() + 20, times[19]);            // a repeated stamp
  times.erase(times.begin() + 100, times.begin() + 106);  // a gap of about 8 ms
  const Preintegration sum = integrate_flight(times);
  EXPECT_EQ(sum.left_out(), 1);
  EXPECT_GT(sum.longest_step_s(), 4e-3);
  EXPECT_NEAR(sum.dt_s(), 1, 1e-12);
  const FusionState end = sum.predict(Flight::state(0), kGravity);
  EXPECT_LT((end.nav.T_map_body.p - Flight::state(1).nav.T_map_body.p).norm(), 2e-5);
}

TEST(Preintegration, BiasCorrectionIsThatOfIntegratingAgain) {
  const auto times = every(2 * kNsPerMs, kNsPerS / 2);
  const Eigen::Vector3d bg(0.003, -0.002, 0.004), ba(0.02, 0.03, -0.01);
  const ImuIncrement first = integrate_flight(times).corrected(bg, ba);
  const ImuIncrement again = integrate_flight(times, bg, ba).corrected(bg, ba);
  const ImuIncrement without = integrate_flight(times).corrected({0, 0, 0}, {0, 0, 0});
  EXPECT_LT((first.dp - again.dp).norm(), 2e-3 * (without.dp - again.dp).norm());
  EXPECT_LT((first.dv - again.dv).norm(), 2e-3 * (without.dv - again.dv).norm());
  EXPECT_LT(first.dq.angularDistance(again.dq), 2e-3 * without.dq.angularDistance(again.dq));
}

TEST(Preintegration, JacobiansOfTheResidualAreItsDifferences) {
  const Preintegration sum = integrate_flight(every(kNsPerMs, 100 * kNsPerMs));
  FusionState start = Flight::state(0), end = sum.predict(start, kGravity);
  Vector15d off;
  off << 1e-3, -2e-3, 3e-3, 0.02, -0.01, 0.03, 0.1, 0.05, -0.02, 1e-3, 2e-3, -1e-3, 0.01, -0.02, 0.03;
  end.add(off);
  start.add(-0.5 * off);
  const auto r = sum.residual(start, end, kGravity);
  const double h = 1e-6;
  for (int k = 0; k < 15; ++k)
    for (const bool at_end : {false, true}) {
      const auto value = [&](double sign) {
        FusionState i = start, j = end;
        (at_end ? j : i).add(sign * h * Vector15d::Unit(k));
        return sum.residual(i, j, kGravity).value;
      };
      const Vector15d difference = (value(1) - value(-1)) / (2 * h);
      EXPECT_LT(((at_end ? r.by_end : r.by_start).col(k) - difference).norm(), 1e-7) << k << " " << at_end;
    }
}

TEST(Preintegration, ResidualVanishesAtThePrediction) {
  const Preintegration sum = integrate_flight(every(kNsPerMs, 50 * kNsPerMs));
  FusionState start = Flight::state(0);
  start.gyro_bias = {0.01, 0.02, -0.01};
  start.accel_bias = {0.1, -0.1, 0.05};
  EXPECT_LT(sum.residual(start, sum.predict(start, kGravity), kGravity).value.norm(), 1e-12);
}

TEST(Preintegration, CovarianceIsThatOfAThousandNoisyRuns) {
  const ImuNoise noise{0.02, 0.05, 0.004, 0.01, 500, {}};
  const TimeNs dt = 2 * kNsPerMs;
  const double dt_s = to_seconds(dt);
  const int steps = 100, runs = 1000;
  Preintegration plain({0, 0, 0}, {0, 0, 0});
  for (int k = 0; k < steps; ++k) plain.add(Flight::sample(k * dt), Flight::sample((k + 1) * dt), noise);
  const FusionState start = Flight::state(0);
  const Eigen::LDLT<Matrix15d> solver(plain.covariance());
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const auto draw = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  double nees = 0;
  Matrix15d sample_covariance = Matrix15d::Zero();
  for (int run = 0; run < runs; ++run) {
    FusionState truth = start;  // biases walk, readings are white
    for (int k = 0; k < steps; ++k) {
      ImuSample a = Flight::sample(k * dt), b = Flight::sample((k + 1) * dt);
      // The bias walks through the step; sqrt(dt / 12) is what its mean scatters beside the line of its ends.
      const Eigen::Vector3d ng = draw(noise.gyro_density / std::sqrt(dt_s)),
                            na = draw(noise.accel_density / std::sqrt(dt_s));
      const Eigen::Vector3d bg = truth.gyro_bias + draw(noise.gyro_walk * std::sqrt(dt_s / 12)),
                            ba = truth.accel_bias + draw(noise.accel_walk * std::sqrt(dt_s / 12));
      truth.nav = strapdown(truth.nav, a, b, bg + ng, ba + na, kGravity);
      truth.gyro_bias += draw(noise.gyro_walk * std::sqrt(dt_s));
      truth.accel_bias += draw(noise.accel_walk * std::sqrt(dt_s));
    }
    const Vector15d e = plain.residual(start, truth, kGravity).value;
    nees += e.dot(solver.solve(e));
    sample_covariance += e * e.transpose() / runs;
  }
  EXPECT_NEAR(nees / runs / 15, 1, 0.05);
  const Matrix15d expected = plain.covariance();
  for (int at = 0; at < 15; at += 3) {
    const double got = sample_covariance.diagonal().segment<3>(at).sum();
    EXPECT_NEAR(got / expected.diagonal().segment<3>(at).sum(), 1, 0.08) << at;
  }
}

// --- a real drone: EuRoC V1_02 beside motion capture ---

std::filesystem::path euroc() {
  const char* variable = std::getenv("EVPOSE_SHARED");
  const std::filesystem::path shared =
      variable != nullptr ? variable : std::filesystem::path(EVPOSE_SOURCE_DIR) / "../shared";
  return shared / "data/real/drone_imu_mocap/euroc_v1_02_medium";
}

std::vector<std::vector<double>> read_table(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || (std::isdigit(static_cast<unsigned char>(line[0])) == 0 && line[0] != '-')) continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    rows.emplace_back();
    for (double v = 0; words >> v;) rows.back().push_back(v);
  }
  return rows;
}

TEST(Preintegration, RealDroneTurnsAsMotionCaptureSaw) {
  if (!std::filesystem::exists(euroc())) GTEST_SKIP() << "no folder " << euroc() << ": set EVPOSE_SHARED";
  const auto imu = read_table(euroc() / "imu.csv"), truth = read_table(euroc() / "groundtruth.csv");
  ASSERT_GT(imu.size(), 10'000U);
  ASSERT_GT(truth.size(), 10'000U);
  const auto sample = [&](std::size_t i) {
    const auto& r = imu[i];
    return ImuSample{from_seconds(r[0]), {r[1], r[2], r[3]}, {r[4], r[5], r[6]}};
  };
  const auto attitude = [&](double t) {
    const auto after = std::lower_bound(truth.begin() + 1, truth.end() - 1, t,
                                        [](const auto& row, double at) { return row[0] < at; });
    const auto& a = *(after - 1);
    const auto& b = *after;
    const auto q = [](const auto& r) { return Eigen::Quaterniond(r[7], r[4], r[5], r[6]).normalized(); };
    return q(a).slerp(std::clamp((t - a[0]) / (b[0] - a[0]), 0.0, 1.0), q(b));
  };
  std::vector<double> errors_deg;
  const double begin = std::max(imu.front()[0], truth.front()[0]),
               end = std::min(imu.back()[0], truth.back()[0]);
  std::size_t i = 0;
  for (double t = begin; t + 0.5 < end; t += 0.5) {
    while (imu[i][0] < t) ++i;
    const auto& bias_row = *std::lower_bound(truth.begin(), truth.end() - 1, t,
                                             [](const auto& row, double at) { return row[0] < at; });
    Preintegration sum({bias_row[11], bias_row[12], bias_row[13]}, {0, 0, 0});
    std::size_t k = i;
    for (; k + 1 < imu.size() && imu[k + 1][0] <= t + 0.5; ++k) sum.add(sample(k), sample(k + 1), ImuNoise{});
    const Eigen::Quaterniond turn = attitude(imu[i][0]).conjugate() * attitude(imu[k][0]);
    const ImuIncrement inc = sum.corrected({bias_row[11], bias_row[12], bias_row[13]}, {0, 0, 0});
    errors_deg.push_back(turn.angularDistance(inc.dq) * 180 / M_PI);
  }
  ASSERT_GT(errors_deg.size(), 100U);
  std::nth_element(errors_deg.begin(),
                   errors_deg.begin() + static_cast<std::ptrdiff_t>(errors_deg.size() / 2), errors_deg.end());
  EXPECT_LT(errors_deg[errors_deg.size() / 2], 0.05);  // 0.045 deg in the data's README
}

}  // namespace
}  // namespace evpose
