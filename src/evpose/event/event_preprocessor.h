// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "evpose/event/event.h"
#include "evpose/event/interest_map.h"
#include "evpose/event/noise_filter.h"
#include "evpose/event/time_surface.h"

namespace evpose {

class ConfigTable;

struct EventPreprocessorConfig {
  NoiseFilterConfig noise;
  double most_mev_s = 100;  ///< events that matter are shed beyond this rate, spread evenly; 0: never
};
void describe(ConfigTable& table, EventPreprocessorConfig& config);

/// An event that is handed on, in microseconds of the stamps' clock.
struct FilteredEvent {
  std::uint32_t stamp_us;
  std::uint16_t x;
  std::uint16_t y : 15;
  std::uint16_t on : 1;
};

/// The way of every event: from where it can matter, below the limit of the rate, through the noise filter to
/// those who look at it; and, if asked for, into the time surface.
class EventPreprocessor {
 public:
  EventPreprocessor(int width, int height, const EventPreprocessorConfig& config);

  /// Takes events of `packet` (a part of it, in order). Events outside the image are counted and left out.
  void take(const EventPacket& packet, std::span<const Event> events);

  /// Where events matter from here on; null: everywhere. The map is kept a reference to.
  void set_interest(const InterestMap* interest) { interest_ = interest; }
  /// Predicted image motion from here on, px/s (a typical one; <= 0: unknown).
  void set_motion(double flow_px_per_s);

  /// Handed on since the last call of clear_kept(), in order of time.
  std::span<const FilteredEvent> kept() const { return kept_; }
  void clear_kept() { kept_.clear(); }

  /// From now on events are appended to `out` as they come, too, unfiltered; null: no longer. `where`: those
  /// that matter by this map alone; null: all in the image.
  void collect(std::vector<FilteredEvent>* out, const InterestMap* where = nullptr) {
    collected_ = out, collected_where_ = where;
  }

  /// From now on every event is drawn into the time surface, or no longer: those that are handed on while
  /// events matter everywhere, else all, as they are. It begins empty, and keeps what it holds while it is
  /// not drawn into. What is handed on is the same with it and without.
  void keep_surface(bool on);
  /// Null unless it is kept.
  const TimeSurface* surface() const { return drawing_ ? &*surface_ : nullptr; }
  /// Stamp of a time on the events' clock, which the surface shares.
  std::uint32_t stamp(TimeNs t) const { return clock_.at(t); }
  const NoiseFilter& noise_filter() const { return noise_filter_; }

  /// Near: where they matter. Kept: handed on. Shed: for the limit of the rate.
  struct Counts {
    std::int64_t read = 0, near = 0, kept = 0, outside = 0, shed = 0;
  };
  const Counts& counts() const { return counts_; }

 private:
  void rebase(std::uint32_t shift_us);
  std::int64_t base_us(const EventPacket& packet, std::span<const Event> events);
  template <class Matters>
  void take_where(std::span<const Event> events, std::int64_t base_us, const Matters& matters);
  void filter(std::span<const FilteredEvent> events);
  void draw(std::span<const Event> events, std::int64_t base_us);
  bool shed(const FilteredEvent& event);

  EventPreprocessorConfig config_;
  int width_, height_;
  StampClock clock_;
  const InterestMap* interest_ = nullptr;
  NoiseFilter noise_filter_;
  std::optional<TimeSurface> surface_;
  bool drawing_ = false;
  std::vector<FilteredEvent>* collected_ = nullptr;
  const InterestMap* collected_where_ = nullptr;
  double allowance_ = 0;  ///< events that may come at once now; refilled at the rate's limit
  std::uint32_t refilled_us_ = 0;
  std::vector<FilteredEvent> kept_;
  Counts counts_;
};

}  // namespace evpose
