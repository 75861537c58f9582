// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/core/time.h"

namespace evpose {

/// One brightness change. Eight bytes, time relative to its packet: the layout that filter and surfaces read
/// fastest (docs/performance.md, "Layout of events").
struct Event {
  std::uint32_t dt_us;      ///< time since the packet's base, microseconds
  std::uint16_t x;          ///< column, 0 at the left
  std::uint16_t y : 15;     ///< row, 0 at the top
  std::uint16_t on : 1;     ///< 1: brighter, 0: darker
};
static_assert(sizeof(Event) == 8, "an event fits eight bytes");

/// Events in order of time; equal times keep the order of the source.
struct EventPacket {
  TimeNs base = 0;  ///< time of dt_us == 0, on the recording's clock
  std::vector<Event> events;

  TimeNs time(const Event& e) const { return base + kNsPerUs * e.dt_us; }
  bool empty() const { return events.empty(); }
};

}  // namespace evpose
