// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event.h"

namespace evpose {

/// A stretch without events.
struct EventGap {
  TimeNs begin = 0, end = 0;  ///< the events on either side
};

struct PixelCount {
  int x = 0, y = 0;
  std::int64_t count = 0;
};

/// What a stream of events looks like as a whole.
struct EventSummary {
  static constexpr TimeNs kHundredth = 10 * kNsPerMs;

  std::int64_t count = 0, on = 0;
  TimeNs first = 0, last = 0;
  int widest_x = 0, highest_y = 0;        ///< largest coordinates seen
  std::int64_t active_pixels = 0;         ///< pixels with at least one event
  std::int64_t most_at_once = 0;          ///< events of one microsecond
  std::vector<std::int64_t> bins;         ///< events in equal parts of the time from `first` on
  TimeNs bin_ns = 1;                      ///< length of a bin
  std::vector<std::uint32_t> hundredths;  ///< events of each 10 ms from `first` on
  std::vector<EventGap> gaps;             ///< the longest first, at most ten
  std::int64_t gap_count = 0;
  std::vector<PixelCount> hot;  ///< the loudest first, at most a hundred
  std::int64_t hot_count = 0, hot_events = 0;
  std::int64_t bursts = 0;  ///< bins of 10 ms with more than ten times the usual rate
  TimeNs loudest_at = 0;    ///< beginning of the loudest 10 ms
  double loudest_rate = 0;  ///< events/s there
  double usual_rate = 0;    ///< events/s, median over the 10 ms with events

  double duration_s() const { return to_seconds(last - first); }
  double mean_rate() const { return duration_s() > 0 ? static_cast<double>(count) / duration_s() : 0; }
};

/// Gathers an EventSummary packet by packet, in memory that does not grow with their number beyond four bytes
/// for each 10 ms.
///
/// A gap is a silence of more than 20 ms that is also longer than a hundred mean distances between events. A
/// pixel is hot when it has more than fifty events, thirty times as many as half of the active pixels have,
/// and ten times as many as its loudest neighbour.
class EventSurvey {
 public:
  void add(const EventPacket& packet);
  EventSummary finish() const;

 private:
  void count_pixel(int x, int y);
  std::int64_t pixel(int x, int y) const;
  void find_hot(EventSummary& out) const;
  void find_bursts(EventSummary& out) const;

  EventSummary sums_;
  std::vector<std::uint32_t> pixels_;  ///< events of each, rows of width_
  int width_ = 0, height_ = 0;
  std::vector<std::uint32_t> hundredths_;  ///< events of each 10 ms from the first event on
  std::vector<EventGap> silences_;         ///< of more than 20 ms, the longest
  std::int64_t at_once_ = 0;
};

}  // namespace evpose
