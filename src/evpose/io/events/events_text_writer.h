// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/camera/camera.h"
#include "evpose/io/events/event_writer.h"
#include "evpose/io/files/atomic_file.h"

namespace evpose {

/// Text, an event a line: `t x y p` with seconds and six decimals, as in the event-camera data sets of 2017;
/// or, at a path that ends by .csv, `%geometry:W,H` and `x,y,p,t` with microseconds.
class EventWriterText : public EventWriter {
 public:
  static Expected<EventWriterText> create(const std::string& path, ImageSize size);

  Status append(const EventPacket& packet) override;
  Status finish() override;

 private:
  EventWriterText(AtomicFile file, ImageSize size, bool commas);

  AtomicFile file_;
  ImageSize size_;
  bool commas_;
  std::string buffer_;
  TimeNs last_ = INT64_MIN;
};

}  // namespace evpose
