// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/imu_gate.h"

#include <algorithm>

namespace evpose {

std::span<const CheckedImu> ImuGate::add(const ImuSample& sample, TimeNs state_t) {
  if (model_ != MotionModel::imu) return {};
  std::span<const CheckedImu> usable = watch_.take(sample);
  // What an instant that was bridged already is told again is too late.
  while (!usable.empty() && !samples_.empty() && usable.front().sample.t <= samples_.back().sample.t)
    usable = usable.subspan(1);
  samples_.insert(samples_.end(), usable.begin(), usable.end());
  // Before the state's time only the last sample matters.
  while (samples_.size() >= 2 && samples_[1].sample.t <= state_t) samples_.pop_front();
  return usable;
}

bool ImuGate::reaches(TimeNs t) const {
  return model_ != MotionModel::imu || (!samples_.empty() && samples_.back().sample.t >= t);
}

ImuTrust ImuGate::trust(const CheckedImu& a, const CheckedImu& b, TimeNs t) const {
  if (contradicts(t)) return ImuTrust::none;
  const ImuTrust reading = std::max(a.trust, b.trust);
  return a.doubted || b.doubted ? std::max(reading, ImuTrust::suspect) : reading;
}

ImuSample ImuGate::held_reading(TimeNs t, const FusionState& state,
                                const Eigen::Vector3d& gravity_map) const {
  return {t, held_gyro_, state.accel_bias - state.nav.T_map_body.q.conjugate() * gravity_map};
}

/// If no sample is near after t, puts one at t that repeats the last reading, to be distrusted. True if so.
/// Which samples have arrived beyond the patience makes no difference.
bool ImuGate::hold_over_silence(TimeNs t, const BackEnd& fusion) {
  const auto next =
      std::find_if(samples_.begin(), samples_.end(), [t](const CheckedImu& s) { return s.sample.t >= t; });
  if (next != samples_.end() && next->sample.t <= t + kPatience) return false;
  CheckedImu held;
  if (next == samples_.begin()) {
    const FusionState& state = fusion.state();
    held.sample = {t, state.gyro_bias,
                   state.accel_bias - state.nav.T_map_body.q.conjugate() * fusion.propagator().gravity_map()};
  } else {
    held = *(next - 1);
  }
  held.sample.t = t;
  held.trust = ImuTrust::none;
  samples_.insert(next, held);
  return true;
}

void ImuGate::enter_or_leave_blindness(BackEnd& fusion, TimeNs t) {
  const bool blind = silent_ || contradicts(t);
  if (blind && !blind_) {
    before_blind_ = fusion.state();
    held_gyro_ = before_blind_.angular_rate + before_blind_.gyro_bias;
  }
  if (!blind && blind_) {
    fusion.start(with_imu_biases(fusion.state()));
    CheckedImu& first = samples_.front();
    if (samples_.size() >= 2 && first.trust == ImuTrust::none) {
      const CheckedImu& next = samples_[1];
      first = {{first.sample.t, next.sample.gyro, next.sample.accel}, ImuTrust::suspect, next.doubted};
    }
  }
  blind_ = blind;
}

/// The state with the biases of the IMU itself, known as well as before it was silent or distrusted.
FusionState ImuGate::with_imu_biases(const FusionState& state) const {
  if (!blind_) return state;
  FusionState out = state;
  out.gyro_bias = before_blind_.gyro_bias;
  out.accel_bias = before_blind_.accel_bias;
  out.covariance.rightCols<6>().setZero();
  out.covariance.bottomRows<6>().setZero();
  out.covariance.bottomRightCorner<6, 6>() = before_blind_.covariance.bottomRightCorner<6, 6>();
  return out;
}

/// Makes the first sample stand at t, by interpolation, or by repeating one that comes later.
void ImuGate::begin_samples_at(TimeNs t) {
  if (samples_.front().sample.t > t) {
    CheckedImu first = samples_.front();
    first.sample.t = t;
    samples_.push_front(first);
  }
  while (samples_.size() >= 2 && samples_[1].sample.t <= t) samples_.pop_front();
  if (samples_.front().sample.t < t)
    samples_.front().sample = interpolate(samples_.front().sample, samples_[1].sample, t);
}

void ImuGate::step(BackEnd& fusion, const CheckedImu& a, const CheckedImu& b, TimeNs t, ImuIncrement* moved) {
  const FusionState& state = fusion.state();
  const Eigen::Vector3d& gravity_map = fusion.propagator().gravity_map();
  agreement_.add_step(
      a.sample, b.sample, with_imu_biases(state), gravity_map,
      fusion.propagator().noise_at(b.sample.gyro, b.sample.accel, std::max(a.trust, b.trust)));
  *moved = joined(*moved, integrate(a.sample, b.sample, state.gyro_bias, state.accel_bias));
  const bool held = contradicts(t);
  fusion.predict(held ? held_reading(a.sample.t, state, gravity_map) : a.sample,
                 held ? held_reading(b.sample.t, state, gravity_map) : b.sample, trust(a, b, t));
}

ImuIncrement ImuGate::predict(BackEnd& fusion, TimeNs t) {
  const TimeNs from = fusion.state().t;
  ImuIncrement moved;
  if (model_ == MotionModel::constant_velocity) {
    moved.dt_s = to_seconds(t - from);
    fusion.predict(t);
    return moved;
  }
  silent_ = hold_over_silence(t, fusion);
  enter_or_leave_blindness(fusion, t);
  if (t == from) return moved;
  begin_samples_at(from);
  while (samples_[1].sample.t < t) {
    step(fusion, samples_[0], samples_[1], t, &moved);
    samples_.pop_front();
  }
  CheckedImu last = samples_[1];
  last.sample = interpolate(samples_[0].sample, samples_[1].sample, t);
  step(fusion, samples_[0], last, t, &moved);
  samples_.front() = last;
  return moved;
}

void ImuGate::compare(const BackEnd& fusion) {
  if (model_ == MotionModel::imu) agreement_.judge(with_imu_biases(fusion.state()), samples_.front().doubted);
}

}  // namespace evpose
