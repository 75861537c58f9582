// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/imu_watch.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr std::array<const char*, 6> kAxes{"gyroscope x",     "gyroscope y",     "gyroscope z",
                                           "accelerometer x", "accelerometer y", "accelerometer z"};
constexpr double kForget_s = 10;          // samples are taken at most so far ahead of their use
constexpr double kRegular = 2;            // intervals up to so many usual ones teach the usual one
constexpr double kLeastClip[] = {1, 15};  // rad/s, m/s^2: smaller readings are not taken as clipped

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
    last_ = s;
    return CheckedImu{s};
  }
  if (s.t <= last_.t) {
    tell(last_.t, s.t < last_.t ? "IMU time goes back" : "IMU time stands still");
    return std::nullopt;
  }
  CheckedImu out{s};
  const double interval_s = to_seconds(s.t - last_.t);
  if (period_s_ == 0) period_s_ = interval_s;
  if (interval_s > config_.gap_periods * period_s_) {
    out.suspect = true;
    tell(last_.t + from_seconds(config_.gap_periods * period_s_), "IMU samples are missing");
    tell(s.t, text("IMU gap of ", std::round(1e4 * interval_s) / 10, " ms"));
  } else if (interval_s < kRegular * period_s_) {
    period_s_ += 0.05 * (interval_s - period_s_);
  }
  int stuck = 0, at = -1;
  for (int i = 0; i < 6; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double value = axis(s, i), magnitude = std::abs(value);
    equal_[k] = value == axis(last_, i) ? equal_[k] + 1 : 0;
    const double range = i < 3 ? config_.gyro_range_rad_s : config_.accel_range_m_s2;
    const bool clipped =
        equal_[k] + 1 >= config_.clipped_samples && magnitude >= largest_[k] && magnitude > kLeastClip[i / 3];
    largest_[k] = std::max(largest_[k], magnitude);
    if (magnitude >= range || clipped) {
      out.suspect = true;
      tell(s.t, text("IMU saturated: ", kAxes[k]));
    }
    if (equal_[k] + 1 >= config_.stuck_samples) ++stuck, at = i;
  }
  if (stuck > 0 && stuck < 6) {
    out.suspect = true;
    tell(s.t, text("IMU stuck: ", kAxes[static_cast<std::size_t>(at)]));
  }
  last_ = s;
  return out;
}

std::string ImuWatch::fault(TimeNs t) const {
  for (auto told = told_.rbegin(); told != told_.rend(); ++told)
    if (told->t <= t) return to_seconds(t - told->t) <= config_.remember_s ? told->what : "";
  return "";
}

}  // namespace evpose
