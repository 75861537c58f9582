// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "evpose/fusion/state_propagator.h"
#include "evpose/imu/imu.h"

namespace evpose {

class ConfigTable;

struct ImuWatchConfig {
  double gyro_range_rad_s = 34.9;   ///< readings from here on are saturated: 2000 deg/s
  double accel_range_m_s2 = 156.9;  ///< readings from here on are saturated: 16 g
};
void describe(ConfigTable& table, ImuWatchConfig& config);

/// A sample that may be used. Saturated readings are replaced by the last good ones, spikes by the line over
/// them.
struct CheckedImu {
  ImuSample sample;
  /// Of its reading; suspect also if the time since the one before is too long; none: there is no such
  /// sample.
  ImuTrust trust = ImuTrust::good;
  bool doubted = false;  ///< its stamp may be wrong
};

/// Looks at each IMU sample before it is used and names what is wrong with the stream.
class ImuWatch {
 public:
  explicit ImuWatch(const ImuWatchConfig& config) : config_(config) {}

  /// The samples that may be used now, in order of time; valid until the next call. None for a sample that
  /// cannot be used: not finite, or its time does not advance. One that may hold a spike is kept back until
  /// those after it tell (fewer than kSpikeSamples), so that a hard change of the motion passes as it is.
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
  void repair(Kept* now);
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
  double changes_ = 0;                   ///< that have been seen: no spike is told without any
  TimeNs doubt_until_ = 0;
  std::string doubt_;  ///< why
  struct Told {
    TimeNs t, until;
    std::string what;
  };
  std::deque<Told> told_;  ///< in order of time
};

}  // namespace evpose
