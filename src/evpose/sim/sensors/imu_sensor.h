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
  ideal,    ///< no fault at all
  pixhawk,  ///< consumer grade, as in autopilots (ICM-20689)
  adis,     ///< calibrated in the factory (ADIS16448)
};

/// A shaking of the frame at one frequency that the trajectory knows nothing of. Zero amplitudes: none.
struct ImuVibrationLine {
  double frequency_hz = 80;
  std::array<double, 3> accel_m_s2 = {};  ///< amplitude per axis
  std::array<double, 3> gyro_deg_s = {};  ///< amplitude per axis
};
void describe(ConfigTable& table, ImuVibrationLine& line);

/// Values below zero are the preset's own.
struct ImuConfig {
  ImuPreset preset = ImuPreset::pixhawk;
  double rate_hz = 200;
  double accel_density = -1;                 ///< m/s^2/sqrt(Hz)
  double accel_walk = -1;                    ///< m/s^3/sqrt(Hz)
  double gyro_density = -1;                  ///< rad/s/sqrt(Hz)
  double gyro_walk = -1;                     ///< rad/s^2/sqrt(Hz)
  double accel_bias = -1, gyro_bias = -1;    ///< at the start, 1 sigma of each axis, m/s^2 and rad/s
  double accel_scale = -1, gyro_scale = -1;  ///< fault of the scale, 1 sigma of each axis
  double accel_misalignment_deg = -1;        ///< of an axis towards another, 1 sigma
  double gyro_misalignment_deg = -1;         ///< of an axis towards another, 1 sigma
  double accel_range_m_s2 = -1, gyro_range_deg_s = -1;  ///< full scale
  double accel_step_m_s2 = -1, gyro_step_deg_s = -1;    ///< of the digits; 0: none
  double time_offset_s = 0;                             ///< stamps are late by this
  double jitter_us = -1;  ///< of the stamps, 1 sigma, up to 0.45 of the interval
  std::array<ImuVibrationLine, 2> lines;
};
void describe(ConfigTable& table, ImuConfig& config);

/// The config with every value of the preset put in.
ImuConfig resolve(const ImuConfig& config);

/// What a faultless IMU reads.
ImuSample ideal_imu(const Motion& motion, TimeNs t);

/// What holds for one sensor all along, drawn from the seed.
struct ImuFaults {
  Eigen::Matrix3d accel_matrix, gyro_matrix;  ///< reading = matrix * truth + bias + noise
  Eigen::Vector3d accel_bias, gyro_bias;      ///< at time 0
};
ImuFaults draw_faults(const ImuConfig& config, std::uint64_t seed);

/// Readings at equal intervals from time 0 to `duration` inclusive, stamped with offset and jitter, in order.
std::vector<ImuSample> simulate_imu(const Trajectory& trajectory, TimeNs duration, const ImuConfig& config,
                                    std::uint64_t seed);

/// What a filter is told of the sensor: the densities, above zero even where the sensor is ideal.
ImuNoise imu_noise(const ImuConfig& config);

}  // namespace evpose::sim
