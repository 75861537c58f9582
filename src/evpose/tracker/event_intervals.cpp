// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/event_intervals.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/tracker/event_bursts.h"

namespace evpose {
namespace {

/// Of a span the events that are kept, where lamps flicker: the same number of each slice, or all that it
/// has.
class FairShare {
 public:
  FairShare(std::span<const std::size_t> ends, double most) {
    std::vector<std::size_t> counts;
    for (std::size_t k = 0; k < ends.size(); ++k) counts.push_back(ends[k] - (k > 0 ? ends[k - 1] : 0));
    std::sort(counts.begin(), counts.end());
    double left = most, slices = static_cast<double>(counts.size());
    for (const std::size_t count : counts) {
      of_slice_ = left / slices;
      if (static_cast<double>(count) > of_slice_) return;
      left -= static_cast<double>(count), slices -= 1;
    }
    of_slice_ = most;
  }
  void add(std::span<const FilteredEvent> slice, std::vector<FilteredEvent>& kept) const {
    const auto count = static_cast<double>(slice.size());
    const double step = std::max(1.0, count / std::max(1.0, of_slice_));
    for (double at = 0; at < count; at += step) kept.push_back(slice[static_cast<std::size_t>(at)]);
  }

 private:
  double of_slice_ = 0;
};

bool has_burst(std::span<const FilteredEvent> events, std::span<const std::size_t> ends) {
  std::size_t begin = 0;
  return std::ranges::any_of(ends, [&](std::size_t end) {
    const std::size_t from = std::exchange(begin, end);
    return changes_as_a_whole(events.subspan(from, end - from));
  });
}

}  // namespace

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
  std::vector<std::size_t> ends;
  if (static_cast<double>(events.size()) > most) ends = slice_ends(events);
  if (has_burst(events, ends)) {
    const FairShare share(ends, most);
    std::size_t begin = 0;
    for (const std::size_t end : ends) {
      const std::size_t from = std::exchange(begin, end);
      share.add(events.subspan(from, end - from), newest.events);
    }
  } else {
    const auto stride = std::max<std::size_t>(
        1, static_cast<std::size_t>(std::ceil(static_cast<double>(events.size()) / most)));
    for (std::size_t i = 0; i < events.size(); i += stride) newest.events.push_back(events[i]);
  }
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
