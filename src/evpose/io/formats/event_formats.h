// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// One kind of file that holds events, and what can be done with it.
struct EventFormat {
  const char* name;        ///< as in events.format
  const char* extensions;  ///< each with its dot, separated by blanks
  /// Whether the first bytes of a file (64 KiB, or all) are of this format; null: they do not tell.
  bool (*recognises)(std::string_view head);
  Expected<std::unique_ptr<EventReader>> (*open)(const std::string& path, const EventReadOptions& options);
  Expected<std::vector<StreamInfo>> (*list)(const std::string& path);
  /// Null: such files hold nothing but events.
  Status (*read_sensors)(const std::string& path, const std::string& name, const SensorSink& sink);
};

/// All formats, in the order in which they are tried.
std::span<const EventFormat> event_formats();

/// The format of that name; or, when it is empty, the one that recognises the content, else the one with the
/// extension, else text. Errors: no such file, unknown name.
Expected<const EventFormat*> find_event_format(const std::string& path, const std::string& name);

}  // namespace evpose
