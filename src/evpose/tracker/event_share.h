// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>

namespace evpose {

/// What share of the image's blocks is looked at, so that no more events have to be than are allowed, and the
/// driver keeps up. Follows from counts of events alone unless the driver sets a limit.
class EventShare {
 public:
  static constexpr double kLeast = 0.05;

  /// `most_mev_s`: of events near contours; 0: any number.
  explicit EventShare(double most_mev_s) : most_per_s_(1e6 * most_mev_s) {}

  /// No more than this share from now on, whatever the rate.
  void set_limit(double share) { limit_ = std::clamp(share, kLeast, 1.0); }
  /// So many events came near contours while a share of the blocks was looked at.
  void learn(std::int64_t events, double span_s, double share) {
    if (!(span_s > 0)) return;
    const double now = static_cast<double>(events) / (span_s * share);
    rate_per_s_ = std::max(now, rate_per_s_ + std::min(1.0, span_s / kMemory_s) * (now - rate_per_s_));
  }
  double share() const {
    if (!(most_per_s_ > 0) || rate_per_s_ <= kFill * most_per_s_) return limit_;
    return std::clamp(kFill * most_per_s_ / rate_per_s_, kLeast, limit_);
  }

 private:
  static constexpr double kFill = 0.8;  // what is allowed is not used up, so that bursts find room
  static constexpr double kMemory_s = 0.03;

  double most_per_s_, limit_ = 1, rate_per_s_ = 0;
};

}  // namespace evpose
