// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/core/error.h"
#include "evpose/event/event.h"

namespace evpose {

/// Writes a file of events, packet by packet. Nothing stands at its path before finish().
class EventWriter {
 public:
  virtual ~EventWriter() = default;

  /// Stamps are rounded down to microseconds. Events must be in order, within and between packets, and inside
  /// the size: faults of ours. Errors: writing failed, a stamp that the format cannot carry.
  virtual Status append(const EventPacket& packet) = 0;
  virtual Status finish() = 0;
};

}  // namespace evpose
