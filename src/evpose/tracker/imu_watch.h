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
  int clipped_samples = 4;  ///< so many equal readings at the largest value yet: saturated below its range
  int stuck_samples = 20;   ///< so many equal readings of one axis while others change: stuck
  double spike_sigma = 8;   ///< a reading so many usual changes from the one before is a spike ...
  double spike_gyro_rad_s2 = 1500;  ///< ... if a vehicle does not change its rate so fast, ...
  double spike_accel_m_s3 = 2e4;    ///< ... or its force
  int spike_samples = 2;            ///< so many in a row are a change of the motion
  double doubt_s = 0.25;            ///< stamps are doubted so long after a gap or a step back
  double remember_s = 0.05;         ///< a fault is told so long after its last sign
};
void describe(ConfigTable& table, ImuWatchConfig& config);

/// A sample that may be used. Readings that are saturated or spikes are replaced by the last good ones.
struct CheckedImu {
  ImuSample sample;
  bool suspect = false;  ///< its reading, or the time since the one before, is not to be relied on
  bool doubted = false;  ///< its stamp may be wrong
  bool missing = false;  ///< there is no such sample
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
  /// Names and replaces what is wrong with single readings; true if anything is.
  bool mend(double interval_s, ImuSample* sample);

  ImuWatchConfig config_;
  ImuSample last_, good_;  ///< as it came; with the last good reading of each axis
  bool any_ = false;
  double period_s_ = 0;  ///< usual interval
  std::array<int, 6> equal_{};
  std::array<double, 6> largest_{};
  std::array<int, 6> spikes_{};          ///< in a row
  std::array<double, 2> mean_square_{};  ///< of the change from sample to sample, by sensor
  TimeNs doubt_until_ = 0;
  std::string doubt_;  ///< why
  struct Told {
    TimeNs t;
    std::string what;
  };
  std::deque<Told> told_;  ///< in order of time
};

}  // namespace evpose
