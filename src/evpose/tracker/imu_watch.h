// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "evpose/imu/imu.h"

namespace evpose {

class ConfigTable;

struct ImuWatchConfig {
  double gap_periods = 3.5;         ///< an interval of so many usual ones is a gap
  double gyro_range_rad_s = 34.9;   ///< readings from here on are saturated: 2000 deg/s
  double accel_range_m_s2 = 156.9;  ///< 16 g
  int clipped_samples = 4;  ///< so many equal readings at the largest value yet: saturated below its range
  int stuck_samples = 12;   ///< so many equal readings of one axis while others change: stuck
  double spike_sigma = 8;   ///< a reading so many usual changes off the last may be a spike ...
  double spike_gyro_rad_s2 = 300;  ///< ... if the rate has changed faster than this, ...
  double spike_accel_m_s3 = 5e3;   ///< ... or the force; it is one if fewer than ...
  int spike_samples = 3;           ///< ... so many in a row are off: these are a change of the motion
  double doubt_s = 0.5;            ///< stamps are doubted so long after a gap or a step back
  double remember_s = 0.05;        ///< a fault is told so long after its last sign
};
void describe(ConfigTable& table, ImuWatchConfig& config);

/// A sample that may be used. Saturated readings are replaced by the last good ones, spikes by the line over
/// them.
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

  /// The samples that may be used now, in order of time; valid until the next call. None for a sample that
  /// cannot be used: not finite, or its time does not advance. One that may hold a spike is kept back until
  /// those after it tell (fewer than spike_samples), so that a hard change of the motion passes as it is.
  std::span<const CheckedImu> take(const ImuSample& sample);

  /// What is wrong at time t by the samples up to then, in words; empty if nothing is. Later samples may have
  /// been taken already.
  std::string fault(TimeNs t) const;

 private:
  /// What is wrong at t, and stays so until then.
  void tell(TimeNs t, std::string what, TimeNs until = 0);
  struct Kept {
    CheckedImu checked;
    std::array<bool, 6> off{};  ///< axes too far from the last good reading
    bool any_off() const;
  };
  /// Names and replaces what is saturated or stuck; finds what is too far off.
  void mend(Kept* now);
  /// Spikes are what was off and, by the newest sample, did not last.
  void flatten_spikes();
  void release();

  ImuWatchConfig config_;
  ImuSample last_, good_;  ///< as it came; with the last good reading of each axis
  std::vector<Kept> kept_;
  std::vector<CheckedImu> released_;
  bool any_ = false;
  double period_s_ = 0;  ///< usual interval
  std::array<int, 6> equal_{};
  std::array<double, 6> largest_{};
  std::array<double, 2> mean_square_{};  ///< of the change from sample to sample, by sensor
  TimeNs doubt_until_ = 0;
  std::string doubt_;  ///< why
  struct Told {
    TimeNs t, until;
    std::string what;
  };
  std::deque<Told> told_;  ///< in order of time
};

}  // namespace evpose
