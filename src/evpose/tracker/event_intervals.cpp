// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/event_intervals.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace evpose {

void EventIntervals::add(std::span<const FilteredEvent> events, std::uint32_t now_us,
                         const ImuIncrement& motion, const Eigen::Vector3d& angular_rate) {
  if (intervals_.empty() || intervals_.back().motion.dt_s >= kInterval_s) {
    if (intervals_.size() == most_) {
      intervals_.push_back(std::move(intervals_.front()));
      intervals_.pop_front();
      intervals_.back().events.clear();
      intervals_.back().motion = {};
    } else {
      intervals_.emplace_back();
    }
  }
  EventInterval& newest = intervals_.back();
  const double most = std::max(1.0, kMostEvents_s * motion.dt_s);
  const auto stride = std::max<std::size_t>(
      1, static_cast<std::size_t>(std::ceil(static_cast<double>(events.size()) / most)));
  for (std::size_t i = 0; i < events.size(); i += stride) newest.events.push_back(events[i]);
  newest.now_us = now_us;
  newest.motion = joined(newest.motion, motion);
  newest.angular_rate = angular_rate;
}

double EventIntervals::duration_s() const {
  double sum = 0;
  for (const EventInterval& interval : intervals_) sum += interval.motion.dt_s;
  return sum;
}

}  // namespace evpose
