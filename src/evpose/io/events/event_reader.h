// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/core/time.h"
#include "evpose/event/event.h"

namespace evpose {

struct EventReadOptions {
  double packet_s = 1e-3;               ///< packets are cut at multiples of this data time; 1 us .. 100 s
  TimeNs offset_ns = 0;                 ///< added to each stamp, after conversion to whole microseconds
  std::optional<TimeNs> t_start_ns;     ///< events before are left out; on the clock after the offset
  std::optional<TimeNs> t_end_ns;       ///< events at or after are left out
  bool flip_x = false, flip_y = false;  ///< need a size
  bool swap_polarity = false;
  ImageSize size;         ///< for range checks and flips; 0x0: what the file says, if it does
  std::string time_unit;  ///< "us", "ns" or "s"; empty: the format's own
  std::string topic;      ///< of bags and other files with several event streams; empty: the first
};

/// Of a whole file: its first and last stamp, offset added, nothing cropped.
struct EventExtent {
  TimeNs first_ns = 0, last_ns = 0;
  std::int64_t count = -1;  ///< -1: not known without reading all
};

/// Streams events in order of time, in bounded memory. Every event is checked: order of time, pixel inside
/// the size, polarity, and a time unit that a sensor could have written; errors name the file and the row or
/// line.
class EventReader {
 public:
  virtual ~EventReader() = default;

  /// Fills `packet` (its buffer is reused) with the next events; false, and an empty packet, at the end. A
  /// packet holds at least one event, never spans a multiple of packet_s, holds at most about a million
  /// events, and never ends between events of equal time.
  virtual Expected<bool> next(EventPacket& packet) = 0;

  /// The given size, or the one of the file; 0x0 when neither says.
  virtual ImageSize size() const = 0;
  virtual EventExtent extent() const = 0;
};

}  // namespace evpose
