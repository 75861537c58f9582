// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/imu/imu.h"
#include "evpose/sim/flight/trajectory.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

enum class ImuPreset : std::uint8_t {
  ideal,    ///< no errors
  pixhawk,  ///< consumer grade, as in autopilots (ICM-20689)
  adis,     ///< factory-calibrated (ADIS16448)
};

/// A vibration of the IMU at one frequency that is not part of the trajectory. Zero amplitudes: none.
struct ImuVibrationLine {
  double frequency_hz = 80;
  std::array<double, 3> accel_m_s2 = {};  ///< amplitude per axis
  std::array<double, 3> gyro_deg_s = {};  ///< amplitude per axis
};
void describe(ConfigTable& table, ImuVibrationLine& line);

/// Negative values are replaced by those of the preset.
struct ImuConfig {
  ImuPreset preset = ImuPreset::pixhawk;
  double rate_hz = 200;
  double accel_density = -1;                 ///< m/s^2/sqrt(Hz)
  double accel_walk = -1;                    ///< m/s^3/sqrt(Hz)
  double gyro_density = -1;                  ///< rad/s/sqrt(Hz)
  double gyro_walk = -1;                     ///< rad/s^2/sqrt(Hz)
  double accel_bias = -1, gyro_bias = -1;    ///< initial bias, 1 sigma of each axis, m/s^2 and rad/s
  double accel_scale = -1, gyro_scale = -1;  ///< scale factor error, 1 sigma of each axis
  double accel_misalignment_deg = -1;        ///< of one axis towards another, 1 sigma
  double gyro_misalignment_deg = -1;         ///< of one axis towards another, 1 sigma
  double accel_range_m_s2 = -1, gyro_range_deg_s = -1;            ///< full scale
  double accel_resolution_m_s2 = -1, gyro_resolution_deg_s = -1;  ///< quantization step; 0: none
  double time_offset_s = 0;                                       ///< delay of the timestamps
  double jitter_us = -1;  ///< jitter of the timestamps, 1 sigma, limited to 0.45 of the interval
  std::array<ImuVibrationLine, 2> lines;
};
void describe(ConfigTable& table, ImuConfig& config);

/// The config with the values of the preset where it has none.
ImuConfig with_preset_values(const ImuConfig& config);

/// Reading of an error-free IMU.
ImuSample ideal_imu(const BodyMotion& motion, TimeNs t);

/// Deterministic errors of one sensor, drawn from the seed.
struct ImuErrors {
  Eigen::Matrix3d accel_matrix, gyro_matrix;  ///< reading = matrix * truth + bias + noise
  Eigen::Vector3d accel_bias, gyro_bias;      ///< at time 0
};
ImuErrors draw_imu_errors(const ImuConfig& config, std::uint64_t seed);

/// Readings at equal intervals from time 0 to `duration` inclusive, with time offset and jitter, in order of
/// timestamp.
std::vector<ImuSample> simulate_imu(const Trajectory& trajectory, TimeNs duration, const ImuConfig& config,
                                    std::uint64_t seed);

/// Noise densities for a filter; above zero even where the sensor is ideal.
ImuNoise imu_noise(const ImuConfig& config);

}  // namespace evpose::sim
