// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "evpose/event/event.h"
#include "evpose/event/noise_filter.h"
#include "evpose/event/time_surface.h"

namespace evpose {

class ConfigTable;

struct EventPreprocessorConfig {
  NoiseFilterConfig noise;
  double most_mev_s = 100;  ///< events are shed beyond this rate, spread evenly; 0: never
};
void describe(ConfigTable& table, EventPreprocessorConfig& config);

/// An event that passed the filter, in microseconds of the stamps' clock.
struct FilteredEvent {
  std::uint32_t stamp_us;
  std::uint16_t x;
  std::uint16_t y : 15;
  std::uint16_t on : 1;
};

/// The way of every event: rate limit and noise filter, in one pass; then, if asked for, the time surface.
class EventPreprocessor {
 public:
  EventPreprocessor(int width, int height, const EventPreprocessorConfig& config);

  /// Takes events of `packet` (a part of it, in order). Events outside the image are counted and left out.
  void take(const EventPacket& packet, std::span<const Event> events);

  /// Predicted image motion from here on, px/s (a typical one; <= 0: unknown).
  void set_motion(double flow_px_per_s);

  /// Kept since the last call of clear_kept(), in order of time.
  std::span<const FilteredEvent> kept() const { return kept_; }
  void clear_kept() { kept_.clear(); }

  /// From now on every event that is kept is drawn into the time surface, or no longer. The surface begins
  /// empty.
  void keep_surface(bool on);
  /// Null unless it is kept.
  const TimeSurface* surface() const { return surface_ ? &*surface_ : nullptr; }
  /// Stamp of a time on the events' clock, which the surface shares.
  std::uint32_t stamp(TimeNs t) const { return clock_.at(t); }
  const NoiseFilter& noise_filter() const { return noise_filter_; }

  struct Counts {
    std::int64_t read = 0, kept = 0, outside = 0, shed = 0;
  };
  const Counts& counts() const { return counts_; }

 private:
  void rebase(std::uint32_t shift_us);
  bool shed(const Event& event, std::uint32_t stamp_us);

  EventPreprocessorConfig config_;
  int width_, height_;
  StampClock clock_;
  NoiseFilter noise_filter_;
  std::optional<TimeSurface> surface_;
  double allowance_ = 0;  ///< events that may come at once now; refilled at the rate's limit
  std::uint32_t refilled_us_ = 0;
  std::vector<FilteredEvent> kept_;
  Counts counts_;
};

}  // namespace evpose
