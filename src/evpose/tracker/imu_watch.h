// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <deque>
#include <optional>
#include <string>

#include "evpose/imu/imu.h"

namespace evpose {

class ConfigTable;

struct ImuWatchConfig {
  double gap_periods = 3.5;         ///< an interval of so many usual ones is a gap
  double gyro_range_rad_s = 34.9;   ///< readings from here on are saturated: 2000 deg/s
  double accel_range_m_s2 = 156.9;  ///< 16 g
  int clipped_samples = 4;   ///< so many equal readings at the largest value yet: saturated below its range
  int stuck_samples = 20;    ///< so many equal readings of one axis while others change: stuck
  double remember_s = 0.05;  ///< a fault is told so long after its last sign
};
void describe(ConfigTable& table, ImuWatchConfig& config);

/// A sample that may be used.
struct CheckedImu {
  ImuSample sample;
  bool suspect = false;  ///< its reading, or the time since the one before, is not to be relied on
};

/// Looks at each IMU sample before it is used and names what is wrong with the stream.
class ImuWatch {
 public:
  explicit ImuWatch(const ImuWatchConfig& config) : config_(config) {}

  /// Nothing for a sample that cannot be used: not finite, or its time does not advance.
  std::optional<CheckedImu> take(const ImuSample& sample);

  /// What is wrong at time t by the samples up to then, in words; empty if nothing is. Later samples may have
  /// been taken already.
  std::string fault(TimeNs t) const;

 private:
  void tell(TimeNs t, std::string what);

  ImuWatchConfig config_;
  ImuSample last_;
  bool any_ = false;
  double period_s_ = 0;  ///< usual interval
  std::array<int, 6> equal_{};
  std::array<double, 6> largest_{};
  struct Told {
    TimeNs t;
    std::string what;
  };
  std::deque<Told> told_;  ///< in order of time
};

}  // namespace evpose
