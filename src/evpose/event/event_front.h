// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/event/event.h"
#include "evpose/event/noise_filter.h"
#include "evpose/event/time_surface.h"

namespace evpose {

class ConfigTable;

struct EventFrontConfig {
  NoiseFilterConfig filter;
  double most_mev_s = 100;  ///< events are shed beyond this rate, spread evenly; 0: never
  double burst_px = 1.0;    ///< a quiet time of this much predicted motion ends a pixel's burst, px
};
void describe(ConfigTable& table, EventFrontConfig& config);

/// An event that passed the filter, on the surface's clock.
struct FrontEvent {
  std::uint32_t stamp_us;
  std::uint16_t x;
  std::uint16_t y : 15;
  std::uint16_t on : 1;
};

/// The way of every event: noise filter, then time surface, in one pass.
class EventFront {
 public:
  EventFront(int width, int height, const EventFrontConfig& config);

  /// Takes events of `packet` (a part of it, in order). Events outside the image are counted and left out.
  void take(const EventPacket& packet, std::span<const Event> events);

  /// Predicted image motion from here on, px/s (a typical one; <= 0: unknown).
  void set_motion(double flow_px_per_s);

  /// Kept since the last call of forget(), in order of time.
  std::span<const FrontEvent> kept() const { return kept_; }
  void forget() { kept_.clear(); }

  const TimeSurface& surface() const { return surface_; }
  /// Stamp on the surface's clock of a time, for reading the surface.
  std::uint32_t stamp(TimeNs t) const { return clock_.at(t); }
  const NoiseFilter& filter() const { return filter_; }

  struct Counts {
    std::int64_t read = 0, kept = 0, outside = 0, shed = 0;
  };
  const Counts& counts() const { return counts_; }

 private:
  void rebase(std::uint32_t shift_us);
  void draw(const FrontEvent& event);
  bool shed(const Event& event, std::uint32_t stamp_us);

  EventFrontConfig config_;
  StampClock clock_;
  NoiseFilter filter_;
  TimeSurface surface_;
  std::uint32_t burst_us_ = 0;
  double allowance_ = 0;  ///< events that may come at once now; refilled at the rate's limit
  std::uint32_t refilled_us_ = 0;
  std::vector<FrontEvent> kept_;
  Counts counts_;
};

}  // namespace evpose
