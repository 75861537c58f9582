// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/imu_watch.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr std::array<const char*, 6> kAxes{"gyroscope x",     "gyroscope y",     "gyroscope z",
                                           "accelerometer x", "accelerometer y", "accelerometer z"};
constexpr double kGapPeriods = 3.5;  // an interval of so many usual ones is a gap
constexpr double kRegular = 2;       // intervals up to so many usual ones teach the usual one
constexpr int kClippedSamples =
    4;  // so many equal readings at the largest value yet: saturated below its range
constexpr int kStuckSamples = 12;         // so many equal readings of one axis while others change: stuck
constexpr double kLeastClip[] = {1, 15};  // rad/s, m/s^2: smaller readings are not taken as clipped
// A reading may be a spike if it is off the last one by so many usual changes, by more than a vehicle can do
// in the time, and by enough to do harm. It is one if fewer than kSpikeSamples in a row are off: more are a
// change of the motion.
constexpr double kSpikeSigma = 8;
constexpr double kSpikeRate[] = {300, 5e3};  // rad/s^2, m/s^3
constexpr double kLeastSpike[] = {0.3, 5};   // rad/s, m/s^2
constexpr int kSpikeSamples = 3;
constexpr double kLearnChange = 0.02;  // share of a sample in the usual change; the first 50 count alike
constexpr double kDoubt_s = 0.5;       // stamps are doubted so long after a gap or a step back
constexpr double kRemember_s = 0.05;   // a fault is reported so long after its last sign
constexpr double kLongestLead_s = 10;  // samples are taken at most so far ahead of their use

double& axis(ImuSample& s, int i) { return i < 3 ? s.gyro[i] : s.accel[i - 3]; }
double axis(const ImuSample& s, int i) { return i < 3 ? s.gyro[i] : s.accel[i - 3]; }

}  // namespace

void describe(ConfigTable& table, ImuWatchConfig& c) {
  table.add("gyro_range_rad_s", c.gyro_range_rad_s, "rad/s", "readings from here on are saturated",
            {0.1, 1e6});
  table.add("accel_range_m_s2", c.accel_range_m_s2, "m/s^2", "readings from here on are saturated", {1, 1e6});
}

void ImuWatch::tell(TimeNs t, std::string what, TimeNs until) {
  while (!told_.empty() && to_seconds(t - told_.front().t) > kLongestLead_s + kRemember_s) told_.pop_front();
  if (!told_.empty() && told_.back().t >= t) return;  // the first sign of one instant is kept
  told_.push_back({t, std::max(t, until), std::move(what)});
}

bool ImuWatch::Kept::any_off() const { return std::find(off.begin(), off.end(), true) != off.end(); }

std::span<const CheckedImu> ImuWatch::take(const ImuSample& s) {
  released_.clear();
  if (!s.gyro.allFinite() || !s.accel.allFinite()) {
    tell(any_ ? last_.t : s.t, "IMU reading is not a number");
    return {};
  }
  if (!any_) {
    any_ = true;
    last_ = good_ = s;
    released_.push_back({s});
    return released_;
  }
  if (s.t <= last_.t) {
    if (s.t < last_.t) doubt_ = "IMU time goes back", doubt_until_ = last_.t + from_seconds(kDoubt_s);
    tell(last_.t, s.t < last_.t ? "IMU time goes back" : "IMU time stands still");
    return {};
  }
  Kept now{{s}};
  const double interval_s = to_seconds(s.t - last_.t);
  if (period_s_ == 0) period_s_ = interval_s;
  if (interval_s > kGapPeriods * period_s_) {
    now.checked.trust = ImuTrust::suspect;
    tell(last_.t + from_seconds(kGapPeriods * period_s_), "IMU samples are missing", s.t);
    doubt_ = text("IMU gap of ", std::round(1e4 * interval_s) / 10, " ms");
    doubt_until_ = s.t + from_seconds(kDoubt_s);
    // What comes after a gap tells nothing of what came before.
    for (Kept& kept : kept_)
      if (kept.any_off()) kept.checked.trust = ImuTrust::suspect;
    release();
  } else if (interval_s < kRegular * period_s_) {
    period_s_ += 0.05 * (interval_s - period_s_);
  }
  repair(&now);
  now.checked.doubted = s.t < doubt_until_;
  last_ = s;
  kept_.push_back(now);
  flatten_spikes();
  const bool lasts = static_cast<int>(kept_.size()) >= kSpikeSamples;
  if (lasts || !kept_.back().any_off()) release();
  if (now.checked.doubted) tell(s.t, doubt_);
  return released_;
}

void ImuWatch::repair(Kept* now) {
  const ImuSample raw = now->checked.sample;
  const double since_good_s = to_seconds(raw.t - good_.t);
  int stuck = 0, stuck_at = -1;
  std::array<double, 2> square{};
  for (int i = 0; i < 6; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto sensor = static_cast<std::size_t>(i / 3);
    const double value = axis(raw, i), magnitude = std::abs(value), change = value - axis(good_, i);
    equal_[k] = value == axis(last_, i) ? equal_[k] + 1 : 0;
    if (equal_[k] + 1 >= kStuckSamples) ++stuck, stuck_at = i;
    const double range = i < 3 ? config_.gyro_range_rad_s : config_.accel_range_m_s2;
    const bool clipped =
        equal_[k] + 1 >= kClippedSamples && magnitude >= largest_[k] && magnitude > kLeastClip[sensor];
    const double usual = std::sqrt(mean_square_[sensor]);
    if (magnitude >= range || clipped) {
      axis(now->checked.sample, i) = axis(good_, i);
      now->checked.trust = ImuTrust::suspect;
      tell(raw.t, text("IMU saturated: ", kAxes[k]));
    } else {
      const double possible = kSpikeRate[sensor] * since_good_s;
      now->off[k] =
          changes_ > 0 && std::abs(change) > std::max({kSpikeSigma * usual, possible, kLeastSpike[sensor]});
      if (!now->off[k]) largest_[k] = std::max(largest_[k], magnitude);
    }
    // A spike teaches no more than the least spike would.
    const double lesson = usual > 0 ? std::min(std::abs(change), kSpikeSigma * usual) : change;
    square[sensor] += lesson * lesson / 3;
  }
  const double share = std::max(kLearnChange, 1.0 / ++changes_);
  for (std::size_t sensor = 0; sensor < 2; ++sensor)
    mean_square_[sensor] += share * (square[sensor] - mean_square_[sensor]);
  if (stuck == 0 || stuck == 6) return;
  tell(raw.t, text("IMU stuck: ", kAxes[static_cast<std::size_t>(stuck_at)]));
  now->checked.trust = ImuTrust::suspect;
}

void ImuWatch::flatten_spikes() {
  const Kept& newest = kept_.back();
  const double span_s = to_seconds(newest.checked.sample.t - good_.t);
  for (std::size_t at = 0; at + 1 < kept_.size(); ++at)
    for (int i = 0; i < 6; ++i) {
      const auto k = static_cast<std::size_t>(i);
      Kept& kept = kept_[at];
      if (!kept.off[k] || newest.off[k]) continue;
      const double share = to_seconds(kept.checked.sample.t - good_.t) / span_s;
      axis(kept.checked.sample, i) =
          axis(good_, i) + share * (axis(newest.checked.sample, i) - axis(good_, i));
      kept.checked.trust = ImuTrust::suspect;
      kept.off[k] = false;
      tell(kept.checked.sample.t, text("IMU spike: ", kAxes[k]));
    }
}

void ImuWatch::release() {
  for (const Kept& kept : kept_) {
    released_.push_back(kept.checked);
    good_ = kept.checked.sample;
    for (int i = 0; i < 6; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (kept.off[k]) largest_[k] = std::max(largest_[k], std::abs(axis(good_, i)));
    }
  }
  kept_.clear();
}

std::string ImuWatch::fault(TimeNs t) const {
  for (auto told = told_.rbegin(); told != told_.rend(); ++told)
    if (told->t <= t) return to_seconds(t - told->until) <= kRemember_s ? told->what : "";
  return "";
}

}  // namespace evpose
