// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "evpose/imu/imu.h"

namespace evpose {

/// What an IMU shows while it does not move.
struct ImuAtRest {
  TimeNs begin = 0, end = 0;                            ///< the longest such stretch
  double total_s = 0;                                   ///< of all
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  ///< mean rate in all of them, rad/s
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();      ///< mean specific force in the longest, m/s^2
  double gyro_density = 0;   ///< white noise, rad/s/sqrt(Hz), from the differences of neighbours
  double accel_density = 0;  ///< m/s^2/sqrt(Hz)
};

/// A stretch without samples.
struct ImuGap {
  TimeNs begin = 0, end = 0;
};

/// What a stream of IMU samples looks like as a whole.
struct ImuSummary {
  std::int64_t count = 0;
  TimeNs first = 0, last = 0;
  double interval_s = 0;     ///< median
  double jitter_s = 0;       ///< median absolute difference from it
  std::vector<ImuGap> gaps;  ///< of more than 2.5 intervals, the longest first, at most ten
  std::int64_t gap_count = 0;
  std::int64_t not_forward = 0;  ///< stamps that repeat or go back
  Eigen::Vector3d mean_gyro = Eigen::Vector3d::Zero(), mean_accel = Eigen::Vector3d::Zero();
  double mean_accel_norm = 0;  ///< of each sample's, m/s^2
  double largest_gyro = 0, largest_accel = 0;
  std::optional<ImuAtRest> at_rest;  ///< unset: it moves all the time

  double duration_s() const { return to_seconds(last - first); }
  double rate_hz() const { return interval_s > 0 ? 1 / interval_s : 0; }
};

/// At rest is a stretch of at least half a second over which neither sensor shows more than its noise:
/// standard deviations below 0.03 rad/s and 0.3 m/s^2 in each window of a quarter of a second, and means that
/// differ by less than 0.02 rad/s and 0.1 m/s^2 from window to window.
ImuSummary survey_imu(const std::vector<ImuSample>& samples);

}  // namespace evpose
