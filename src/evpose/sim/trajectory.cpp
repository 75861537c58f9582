// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/trajectory.h"

#include <cmath>
#include <numbers>

#include "evpose/sim/random.h"

namespace evpose::sim {
namespace {

struct Derivatives {
  double value, first, second;
};

Derivatives evaluate(const Trajectory::Channel& channel, double t) {
  Derivatives d{channel.offset, 0, 0};
  for (const Trajectory::Wave& w : channel.waves) {
    const double s = std::sin(w.omega * t + w.phase), c = std::cos(w.omega * t + w.phase);
    const double amplitude = w.amplitude + w.growth * t;
    d.value += amplitude * s;
    d.first += w.growth * s + amplitude * w.omega * c;
    d.second += 2 * w.growth * w.omega * c - amplitude * w.omega * w.omega * s;
  }
  return d;
}

}  // namespace

Motion Trajectory::at(double t_s) const {
  std::array<Derivatives, 6> d;
  for (std::size_t i = 0; i < d.size(); ++i) d[i] = evaluate(channels_[i], t_s);
  Motion m;
  const double yaw = d[3].value, pitch = d[4].value, roll = d[5].value;
  m.T_map_body.q = so3::exp(yaw * Eigen::Vector3d::UnitZ()) * so3::exp(pitch * Eigen::Vector3d::UnitY()) *
                   so3::exp(roll * Eigen::Vector3d::UnitX());
  m.T_map_body.p = {d[0].value, d[1].value, d[2].value};
  m.velocity = {d[0].first, d[1].first, d[2].first};
  m.acceleration = {d[0].second, d[1].second, d[2].second};
  // Each Euler rate about its own axis, seen from the body.
  m.rate = {d[5].first - d[3].first * std::sin(pitch),
            d[4].first * std::cos(roll) + d[3].first * std::cos(pitch) * std::sin(roll),
            -d[4].first * std::sin(roll) + d[3].first * std::cos(pitch) * std::cos(roll)};
  return m;
}

Trajectory make_square_spiral(std::uint64_t seed) {
  constexpr double kQuarter = 0.5 * std::numbers::pi;
  constexpr double kOmega = 1.7;                   // rad/s round the spiral
  constexpr double kRadius = 0.3, kGrowth = 0.03;  // m, m/s
  constexpr double kSquare = 0.1;  // share of the third harmonic that makes a circle a rounded square
  Random random(seed, 2);
  const double start = random.uniform(0, 2 * std::numbers::pi);
  const auto round = [&](double phase, double third_sign) {
    return std::vector<Trajectory::Wave>{
        {kRadius, kGrowth, kOmega, start + phase},
        {third_sign * kSquare * kRadius, third_sign * kSquare * kGrowth, 3 * kOmega, 3 * start + phase}};
  };
  const auto sway = [&](double amplitude, double omega) {
    return Trajectory::Wave{amplitude, 0, omega, random.uniform(0, 2 * std::numbers::pi)};
  };
  // y = cos a - c cos 3a, z = sin a + c sin 3a: corners at 45 degrees.
  std::array<Trajectory::Channel, 6> channels;
  channels[0] = {1.1, {sway(0.13, 1.9), sway(0.02, 4.3)}};
  channels[1] = {2.45, round(kQuarter, -1)};
  channels[2] = {1.4, round(0, 1)};
  channels[3] = {0.02, {sway(0.09, 1.6), sway(0.02, 4.7)}};
  channels[4] = {0.06, {sway(0.055, 2.1), sway(0.012, 5.3)}};
  channels[5] = {0.0, {sway(0.05, 2.4), sway(0.012, 6.1)}};
  return Trajectory(channels);
}

}  // namespace evpose::sim
