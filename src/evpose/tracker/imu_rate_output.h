// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <functional>
#include <span>

#include "evpose/tracker/imu_gate.h"

namespace evpose {

/// The state at each IMU sample: that of the newest update not after it, carried on by the IMU. Which update
/// that is does not depend on when samples and packets arrive.
class ImuRateOutput {
 public:
  using Callback = std::function<void(const FusionState&)>;
  void set_callback(Callback callback) { callback_ = std::move(callback); }

  void add(std::span<const CheckedImu> samples);
  /// Goes on from the state of an update, at which the IMU reads `reading`.
  void restart(const FusionState& state, const ImuSample& reading);
  /// Reports the states at the samples before `until`, the time of the next update.
  void report_until(TimeNs until, const BackEnd& fusion, const ImuGate& gate);

 private:
  Callback callback_;
  std::deque<CheckedImu> waiting_;
  FusionState state_;  ///< at the last sample reported
  ImuSample reading_;  ///< of the same time
  bool started_ = false;
};

}  // namespace evpose
