// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "evpose/io/events/event_block.h"
#include "evpose/io/events/event_reader.h"

namespace evpose {

/// What a format that is decoded from the first byte to the last has to provide.
class EventSource {
 public:
  virtual ~EventSource() = default;

  /// Replaces the block, by start(), by the next events; false at the end. Blocks of none are allowed.
  virtual Expected<bool> fetch(EventBlock& block) = 0;
  /// Called once, at the end: to tell of what was met on the way.
  virtual void finish() const {}
};

using OpenEventSource = std::function<Expected<std::unique_ptr<EventSource>>()>;

/// An EventReader over a source: checks, crop, flips and packets. `size` is what the file says, or 0x0. The
/// extent is found when it is asked for, by a second pass over the file. Errors: those of `open`, a file
/// without events, a time unit other than "us" in the options: such formats have their own.
Expected<std::unique_ptr<EventReader>> make_event_reader(const std::string& path,
                                                         const EventReadOptions& options, ImageSize size,
                                                         OpenEventSource open);

}  // namespace evpose
