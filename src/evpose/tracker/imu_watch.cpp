// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/imu_watch.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr std::array<const char*, 6> kAxes{"gyroscope x",     "gyroscope y",     "gyroscope z",
                                           "accelerometer x", "accelerometer y", "accelerometer z"};
constexpr double kForget_s = 10;            // samples are taken at most so far ahead of their use
constexpr double kRegular = 2;              // intervals up to so many usual ones teach the usual one
constexpr double kLeastClip[] = {1, 15};    // rad/s, m/s^2: smaller readings are not taken as clipped
constexpr double kLeastSpike[] = {0.3, 5};  // rad/s, m/s^2: smaller ones do no harm
constexpr double kLearnChange = 0.02;       // share of a sample in the usual change

double& axis(ImuSample& s, int i) { return i < 3 ? s.gyro[i] : s.accel[i - 3]; }
double axis(const ImuSample& s, int i) { return i < 3 ? s.gyro[i] : s.accel[i - 3]; }

}  // namespace

void describe(ConfigTable& table, ImuWatchConfig& c) {
  table.add("gap_periods", c.gap_periods, "", "an interval of so many usual ones is a gap", {1.5, 1e6});
  table.add("gyro_range_rad_s", c.gyro_range_rad_s, "rad/s", "readings from here on are saturated",
            {0.1, 1e6});
  table.add("accel_range_m_s2", c.accel_range_m_s2, "m/s^2", "readings from here on are saturated", {1, 1e6});
  table.add("clipped_samples", c.clipped_samples, "", "equal largest readings that are saturation", {2, 1e6});
  table.add("stuck_samples", c.stuck_samples, "", "equal readings of one axis that are a stuck sensor",
            {3, 1e6});
  table.add("spike_sigma", c.spike_sigma, "",
            "a reading so many usual changes from the one before is a spike", {1, 1e6});
  table.add("spike_gyro_rad_s2", c.spike_gyro_rad_s2, "rad/s^2", "... if the rate changes faster than this",
            {0, 1e9});
  table.add("spike_accel_m_s3", c.spike_accel_m_s3, "m/s^3", "... or the force faster than this", {0, 1e9});
  table.add("spike_samples", c.spike_samples, "", "spikes in a row that are a change of the motion",
            {1, 1e6});
  table.add("doubt_s", c.doubt_s, "s", "stamps are doubted so long after a gap or a step back", {0, 100});
  table.add("remember_s", c.remember_s, "s", "a fault is told so long after its last sign", {0, 100});
}

void ImuWatch::tell(TimeNs t, std::string what) {
  while (!told_.empty() && to_seconds(t - told_.front().t) > kForget_s + config_.remember_s)
    told_.pop_front();
  if (!told_.empty() && told_.back().t >= t) return;  // the first sign of one instant is kept
  told_.push_back({t, std::move(what)});
}

std::optional<CheckedImu> ImuWatch::take(const ImuSample& s) {
  if (!s.gyro.allFinite() || !s.accel.allFinite()) {
    tell(any_ ? last_.t : s.t, "IMU reading is not a number");
    return std::nullopt;
  }
  if (!any_) {
    any_ = true;
    last_ = good_ = s;
    return CheckedImu{s};
  }
  if (s.t <= last_.t) {
    if (s.t < last_.t) doubt_ = "IMU time goes back", doubt_until_ = last_.t + from_seconds(config_.doubt_s);
    tell(last_.t, s.t < last_.t ? "IMU time goes back" : "IMU time stands still");
    return std::nullopt;
  }
  CheckedImu out{s};
  const double interval_s = to_seconds(s.t - last_.t);
  if (period_s_ == 0) period_s_ = interval_s;
  if (interval_s > config_.gap_periods * period_s_) {
    out.suspect = true;
    tell(last_.t + from_seconds(config_.gap_periods * period_s_), "IMU samples are missing");
    doubt_ = text("IMU gap of ", std::round(1e4 * interval_s) / 10, " ms");
    doubt_until_ = s.t + from_seconds(config_.doubt_s);
  } else if (interval_s < kRegular * period_s_) {
    period_s_ += 0.05 * (interval_s - period_s_);
  }
  out.suspect |= mend(interval_s, &out.sample);
  if (s.t < doubt_until_) {
    out.doubted = true;
    tell(s.t, doubt_);
  }
  last_ = s;
  good_ = out.sample;
  return out;
}

bool ImuWatch::mend(double interval_s, ImuSample* s) {
  const ImuSample raw = *s;
  bool wrong = false;
  int stuck = 0, stuck_at = -1;
  std::array<double, 2> square{};
  for (int i = 0; i < 6; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const int sensor = i / 3;
    const double value = axis(raw, i), magnitude = std::abs(value), change = value - axis(good_, i);
    equal_[k] = value == axis(last_, i) ? equal_[k] + 1 : 0;
    if (equal_[k] + 1 >= config_.stuck_samples) ++stuck, stuck_at = i;
    const double range = i < 3 ? config_.gyro_range_rad_s : config_.accel_range_m_s2;
    const bool clipped = equal_[k] + 1 >= config_.clipped_samples && magnitude >= largest_[k] &&
                         magnitude > kLeastClip[sensor];
    const double usual = std::sqrt(mean_square_[static_cast<std::size_t>(sensor)]);
    const double possible = (i < 3 ? config_.spike_gyro_rad_s2 : config_.spike_accel_m_s3) * interval_s;
    const bool spike =
        std::abs(change) > std::max({config_.spike_sigma * usual, possible, kLeastSpike[sensor]});
    const bool saturated = magnitude >= range || clipped;
    spikes_[k] = spike && !saturated ? spikes_[k] + 1 : 0;
    if (spike && spikes_[k] >= config_.spike_samples) spikes_[k] = 0;  // so it is, whatever it is
    if (saturated || spikes_[k] > 0) {
      axis(*s, i) = axis(good_, i);
      wrong = true;
      tell(raw.t, text(saturated ? "IMU saturated: " : "IMU spike: ", kAxes[k]));
    } else {
      largest_[k] = std::max(largest_[k], magnitude);
    }
    // A spike teaches no more than the least spike would.
    const double lesson = usual > 0 ? std::min(std::abs(change), config_.spike_sigma * usual) : change;
    square[static_cast<std::size_t>(sensor)] += lesson * lesson / 3;
  }
  for (std::size_t sensor = 0; sensor < 2; ++sensor)
    mean_square_[sensor] += kLearnChange * (square[sensor] - mean_square_[sensor]);
  if (stuck == 0 || stuck == 6) return wrong;
  tell(raw.t, text("IMU stuck: ", kAxes[static_cast<std::size_t>(stuck_at)]));
  return true;
}

std::string ImuWatch::fault(TimeNs t) const {
  for (auto told = told_.rbegin(); told != told_.rend(); ++told)
    if (told->t <= t) return to_seconds(t - told->t) <= config_.remember_s ? told->what : "";
  return "";
}

}  // namespace evpose
