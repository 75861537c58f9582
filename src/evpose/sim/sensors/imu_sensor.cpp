// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/imu_sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/config.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kNoLimit = 1e9;
// Independent random streams, so that changing one setting leaves the other errors unchanged.
enum Stream : std::uint64_t { kErrors = 31, kGyroNoise, kAccelNoise, kGyroWalk, kAccelWalk, kJitter, kLines };

Vector3d normal(Random& random, double sigma) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return {sigma * x, sigma * y, sigma * z};
}

// Data sheets of the ICM-20689 and the ADIS16448; typical random walks and turn-on biases.
ImuConfig preset(ImuPreset which) {
  ImuConfig c;
  c.preset = which;
  c.accel_density = c.accel_walk = c.gyro_density = c.gyro_walk = c.accel_bias = c.gyro_bias = 0;
  c.accel_scale = c.gyro_scale = c.accel_misalignment_deg = c.gyro_misalignment_deg = 0;
  c.accel_resolution_m_s2 = c.gyro_resolution_deg_s = c.jitter_us = 0;
  c.accel_range_m_s2 = c.gyro_range_deg_s = kNoLimit;
  if (which == ImuPreset::pixhawk) {
    c.accel_density = 1.5e-3, c.accel_walk = 2e-4, c.gyro_density = 1.05e-4, c.gyro_walk = 1e-5;
    c.accel_bias = 0.1, c.gyro_bias = 0.01;
    c.accel_scale = 0.003, c.gyro_scale = 0.005;
    c.accel_misalignment_deg = c.gyro_misalignment_deg = 0.2;
    c.accel_range_m_s2 = 16 * 9.80665, c.gyro_range_deg_s = 2000;
    c.accel_resolution_m_s2 = 16 * 9.80665 / 32768, c.gyro_resolution_deg_s = 2000.0 / 32768;
    c.jitter_us = 50;
  } else if (which == ImuPreset::adis) {
    c.accel_density = 2.26e-3, c.accel_walk = 3e-4, c.gyro_density = 2.36e-4, c.gyro_walk = 2e-5;
    c.accel_bias = 0.1, c.gyro_bias = 0.005;
    c.accel_scale = 0.001, c.gyro_scale = 0.002;
    c.accel_misalignment_deg = c.gyro_misalignment_deg = 0.05;
    c.accel_range_m_s2 = 18 * 9.80665, c.gyro_range_deg_s = 1000;
    c.accel_resolution_m_s2 = 0.833e-3 * 9.80665, c.gyro_resolution_deg_s = 0.04;
    c.jitter_us = 5;
  }
  return c;
}

Vector3d saturate_and_quantize(const Vector3d& value, double range, double step) {
  Vector3d out = value.cwiseMax(-range).cwiseMin(range);
  if (step > 0) out = step * (out / step).array().round();
  return out;
}

/// Vibration lines with random phases.
class VibrationLines {
 public:
  VibrationLines(const ImuConfig& config, std::uint64_t seed) : lines_(config.lines) {
    Random random(seed, kLines);
    for (auto& phases : phases_)
      for (double& phase : phases) phase = random.uniform(0, 2 * std::numbers::pi);
  }
  void add_to(ImuSample& sample, double t_s) const {
    for (std::size_t i = 0; i < lines_.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const double angle = 2 * std::numbers::pi * lines_[i].frequency_hz * t_s;
        sample.accel[axis] += lines_[i].accel_m_s2[axis] * std::sin(angle + phases_[i][axis]);
        sample.gyro[axis] += kDegree * lines_[i].gyro_deg_s[axis] * std::sin(angle + phases_[i][3 + axis]);
      }
  }

 private:
  std::array<ImuVibrationLine, 2> lines_;
  std::array<std::array<double, 6>, 2> phases_{};
};

}  // namespace

void describe(ConfigTable& table, ImuVibrationLine& line) {
  table.add("frequency_hz", line.frequency_hz, "Hz", "of the vibration", {0.1, 1e5});
  const char* axes[] = {"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i)
    table.add(text("accel_", axes[i], "_m_s2"), line.accel_m_s2[i], "m/s^2", "amplitude", {0, 1e3});
  for (std::size_t i = 0; i < 3; ++i)
    table.add(text("gyro_", axes[i], "_deg_s"), line.gyro_deg_s[i], "deg/s", "amplitude", {0, 1e4});
}

void describe(ConfigTable& table, ImuConfig& c) {
  table.add("preset", c.preset,
            ConfigTable::Choices<ImuPreset>{
                {"ideal", ImuPreset::ideal}, {"pixhawk", ImuPreset::pixhawk}, {"adis", ImuPreset::adis}},
            "class of the sensor; -1 below selects its value");
  table.add("rate_hz", c.rate_hz, "Hz", "sampling rate", {10, 8000});
  table.add("accel_density", c.accel_density, "m/s^2/sqrt(Hz)", "white noise", {-1, 10});
  table.add("accel_walk", c.accel_walk, "m/s^3/sqrt(Hz)", "random walk of the bias", {-1, 10});
  table.add("gyro_density", c.gyro_density, "rad/s/sqrt(Hz)", "white noise", {-1, 10});
  table.add("gyro_walk", c.gyro_walk, "rad/s^2/sqrt(Hz)", "random walk of the bias", {-1, 10});
  table.add("accel_bias", c.accel_bias, "m/s^2", "initial bias, 1 sigma", {-1, 10});
  table.add("gyro_bias", c.gyro_bias, "rad/s", "initial bias, 1 sigma", {-1, 10});
  table.add("accel_scale", c.accel_scale, "", "scale factor error, 1 sigma", {-1, 0.5});
  table.add("gyro_scale", c.gyro_scale, "", "scale factor error, 1 sigma", {-1, 0.5});
  table.add("accel_misalignment_deg", c.accel_misalignment_deg, "deg", "of one axis towards another, 1 sigma",
            {-1, 20});
  table.add("gyro_misalignment_deg", c.gyro_misalignment_deg, "deg", "of one axis towards another, 1 sigma",
            {-1, 20});
  table.add("accel_range_m_s2", c.accel_range_m_s2, "m/s^2", "full scale", {-1, kNoLimit});
  table.add("gyro_range_deg_s", c.gyro_range_deg_s, "deg/s", "full scale", {-1, kNoLimit});
  table.add("accel_resolution_m_s2", c.accel_resolution_m_s2, "m/s^2", "quantization step; 0: none",
            {-1, 10});
  table.add("gyro_resolution_deg_s", c.gyro_resolution_deg_s, "deg/s", "quantization step; 0: none",
            {-1, 100});
  table.add("time_offset_s", c.time_offset_s, "s", "delay of the timestamps", {-1, 1});
  table.add("jitter_us", c.jitter_us, "us", "jitter of the timestamps, 1 sigma", {-1, 1e5});
  table.group("line_1", c.lines[0]);
  table.group("line_2", c.lines[1]);
}

ImuConfig with_preset_values(const ImuConfig& config) {
  const ImuConfig own = preset(config.preset);
  ImuConfig out = config;
  for (const auto member :
       {&ImuConfig::accel_density, &ImuConfig::accel_walk, &ImuConfig::gyro_density, &ImuConfig::gyro_walk,
        &ImuConfig::accel_bias, &ImuConfig::gyro_bias, &ImuConfig::accel_scale, &ImuConfig::gyro_scale,
        &ImuConfig::accel_misalignment_deg, &ImuConfig::gyro_misalignment_deg, &ImuConfig::accel_range_m_s2,
        &ImuConfig::gyro_range_deg_s, &ImuConfig::accel_resolution_m_s2, &ImuConfig::gyro_resolution_deg_s,
        &ImuConfig::jitter_us})
    if (out.*member < 0) out.*member = own.*member;
  return out;
}

ImuSample ideal_imu(const BodyMotion& motion, TimeNs t) {
  return {t, motion.rate, motion.T_map_body.q.conjugate() * (motion.acceleration - gravity_map())};
}

ImuErrors draw_imu_errors(const ImuConfig& config, std::uint64_t seed) {
  const ImuConfig c = with_preset_values(config);
  Random random(seed, kErrors);
  const auto matrix = [&](double scale, double misalignment) {
    Eigen::Matrix3d m;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        m(row, column) = row == column ? 1 + scale * random.normal() : misalignment * random.normal();
    return m;
  };
  ImuErrors errors;
  errors.accel_matrix = matrix(c.accel_scale, kDegree * c.accel_misalignment_deg);
  errors.gyro_matrix = matrix(c.gyro_scale, kDegree * c.gyro_misalignment_deg);
  errors.accel_bias = normal(random, c.accel_bias);
  errors.gyro_bias = normal(random, c.gyro_bias);
  return errors;
}

std::vector<ImuSample> simulate_imu(const Trajectory& trajectory, TimeNs duration, const ImuConfig& config,
                                    std::uint64_t seed) {
  const ImuConfig c = with_preset_values(config);
  const ImuErrors errors = draw_imu_errors(config, seed);
  Random gyro_noise(seed, kGyroNoise), accel_noise(seed, kAccelNoise), jitter(seed, kJitter);
  Random gyro_walk(seed, kGyroWalk), accel_walk(seed, kAccelWalk);
  const VibrationLines lines(c, seed);
  const double root_rate = std::sqrt(c.rate_hz);
  constexpr double kLargestJitter = 0.45;  // of the interval: keeps the timestamps in order
  Vector3d gyro_bias = errors.gyro_bias, accel_bias = errors.accel_bias;
  std::vector<ImuSample> samples;
  for (std::int64_t i = 0;; ++i) {
    const double t_s = static_cast<double>(i) / c.rate_hz;
    const TimeNs t = from_seconds(t_s);
    if (t > duration) return samples;
    ImuSample sample = ideal_imu(trajectory.at(t_s), t);
    lines.add_to(sample, t_s);
    sample.gyro =
        errors.gyro_matrix * sample.gyro + gyro_bias + normal(gyro_noise, c.gyro_density * root_rate);
    sample.accel =
        errors.accel_matrix * sample.accel + accel_bias + normal(accel_noise, c.accel_density * root_rate);
    sample.gyro =
        saturate_and_quantize(sample.gyro, kDegree * c.gyro_range_deg_s, kDegree * c.gyro_resolution_deg_s);
    sample.accel = saturate_and_quantize(sample.accel, c.accel_range_m_s2, c.accel_resolution_m_s2);
    const double shift_s = std::clamp(1e-6 * c.jitter_us * jitter.normal(), -kLargestJitter / c.rate_hz,
                                      kLargestJitter / c.rate_hz);
    sample.t += from_seconds(c.time_offset_s + shift_s);
    samples.push_back(sample);
    gyro_bias += normal(gyro_walk, c.gyro_walk / root_rate);
    accel_bias += normal(accel_walk, c.accel_walk / root_rate);
  }
}

ImuNoise imu_noise(const ImuConfig& config) {
  const ImuConfig c = with_preset_values(config);
  // A filter divides by these densities.
  ImuNoise noise;
  noise.accel_density = std::max(c.accel_density, 1e-4);
  noise.accel_walk = std::max(c.accel_walk, 1e-5);
  noise.gyro_density = std::max(c.gyro_density, 1e-5);
  noise.gyro_walk = std::max(c.gyro_walk, 1e-6);
  noise.rate_hz = c.rate_hz;
  return noise;
}

}  // namespace evpose::sim
