// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/imu_rate_output.h"

namespace evpose {

void ImuRateOutput::add(std::span<const CheckedImu> samples) {
  if (callback_) waiting_.insert(waiting_.end(), samples.begin(), samples.end());
}

void ImuRateOutput::restart(const FusionState& state, const ImuSample& reading) {
  if (!callback_) return;
  state_ = state;
  reading_ = reading;
  started_ = true;
}

void ImuRateOutput::report_until(TimeNs until, const BackEnd& fusion, const ImuGate& gate) {
  for (; !waiting_.empty() && waiting_.front().sample.t < until; waiting_.pop_front()) {
    const CheckedImu& next = waiting_.front();
    if (!started_ || next.sample.t <= state_.t) continue;
    const TimeNs t = fusion.state().t;
    const Eigen::Vector3d& gravity_map = fusion.propagator().gravity_map();
    const bool held = gate.contradicts(t);
    fusion.propagator().propagate(state_,
                                  held ? gate.held_reading(reading_.t, state_, gravity_map) : reading_,
                                  held ? gate.held_reading(next.sample.t, state_, gravity_map) : next.sample,
                                  gate.trust(next, next, t));
    reading_ = next.sample;
    callback_(state_);
  }
}

}  // namespace evpose
