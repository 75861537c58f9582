// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/core/time.h"

namespace evpose {

/// One brightness change. Eight bytes, time relative to its packet: the layout that filter and surfaces read
/// fastest (docs/results/performance.md, "Layout of events").
struct Event {
  std::uint32_t dt_us;   ///< time since the packet's base, microseconds
  std::uint16_t x;       ///< column, 0 at the left
  std::uint16_t y : 15;  ///< row, 0 at the top
  std::uint16_t on : 1;  ///< 1: brighter, 0: darker
};
static_assert(sizeof(Event) == 8, "an event fits eight bytes");

/// `y` below 32768.
inline Event make_event(std::uint32_t dt_us, int x, int y, bool on) {
  Event e{};
  e.dt_us = dt_us;
  e.x = static_cast<std::uint16_t>(x);
  e.y = static_cast<std::uint16_t>(y & 0x7FFF);
  e.on = on ? 1 : 0;
  return e;
}

/// Events in order of time; equal times keep the order of the source.
struct EventPacket {
  TimeNs base = 0;  ///< time of dt_us == 0, on the recording's clock
  std::vector<Event> events;

  TimeNs time(const Event& e) const { return base + kNsPerUs * e.dt_us; }
  bool empty() const { return events.empty(); }
};

}  // namespace evpose
