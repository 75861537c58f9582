// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/event_bursts.h"

#include <algorithm>

namespace evpose {
namespace {

constexpr std::size_t kQuietOf = 20;    // one slice in so many lies between bursts
constexpr std::size_t kTimesQuiet = 3;  // a burst has more events,
constexpr double kOneWay = 0.85;        // and of these so many are of one polarity
constexpr std::size_t kFew = 20;        // events of a slice that may come by chance

/// Calls take(slice) for each.
template <class Take>
void for_slices(std::span<const FilteredEvent> events, const Take& take) {
  const auto slice = [&](std::size_t i) {
    return (events[i].stamp_us - events.front().stamp_us) / kEventSlice_us;
  };
  std::size_t begin = 0;
  for (std::size_t i = 0; i < events.size(); ++i)
    if (i + 1 == events.size() || slice(i + 1) != slice(i)) {
      take(events.subspan(begin, i + 1 - begin));
      begin = i + 1;
    }
}

}  // namespace

std::vector<std::size_t> slice_ends(std::span<const FilteredEvent> events) {
  std::vector<std::size_t> ends;
  for_slices(events, [&](std::span<const FilteredEvent> slice) {
    ends.push_back(slice.size() + (ends.empty() ? 0 : ends.back()));
  });
  return ends;
}

bool changes_as_a_whole(std::span<const FilteredEvent> slice) {
  if (slice.size() <= kFew) return false;
  const auto on = std::ranges::count_if(slice, [](const FilteredEvent& e) { return e.on != 0; });
  const double share = static_cast<double>(on) / static_cast<double>(slice.size());
  return std::max(share, 1 - share) > kOneWay;
}

/// Events of a slice in which nothing flickers.
std::size_t EventBursts::quiet_count() const {
  std::array<std::size_t, kSlices> sorted = counts_;
  const std::size_t known = std::min(seen_, kSlices);
  const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(known / kQuietOf);
  std::nth_element(sorted.begin(), at, sorted.begin() + static_cast<std::ptrdiff_t>(known));
  return *at;
}

std::span<const FilteredEvent> EventBursts::quiet(std::span<const FilteredEvent> events) {
  if (events.empty()) return events;
  for_slices(events,
             [&](std::span<const FilteredEvent> slice) { counts_[seen_++ % kSlices] = slice.size(); });
  const std::size_t most = kTimesQuiet * std::max(quiet_count(), kFew);
  const auto is_burst = [&](std::span<const FilteredEvent> slice) {
    return slice.size() > most && changes_as_a_whole(slice);
  };
  bool bursts = false;
  for_slices(events, [&](std::span<const FilteredEvent> slice) { bursts = bursts || is_burst(slice); });
  if (!bursts) return events;
  quiet_.clear();
  for_slices(events, [&](std::span<const FilteredEvent> slice) {
    if (!is_burst(slice)) quiet_.insert(quiet_.end(), slice.begin(), slice.end());
  });
  return quiet_;
}

}  // namespace evpose
