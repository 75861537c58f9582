// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/formats/open_events.h"

#include "evpose/io/formats/event_formats.h"

namespace evpose {

Expected<std::unique_ptr<EventReader>> open_events(const std::string& path, const std::string& format,
                                                   const EventReadOptions& options) {
  const auto found = find_event_format(path, format);
  if (!found) return found.error();
  return (*found)->open(path, options);
}

Expected<std::vector<StreamInfo>> list_streams(const std::string& path) {
  const auto format = find_event_format(path, "");
  if (!format) return format.error();
  return (*format)->list(path);
}

Status read_sensors(const std::string& path, const std::string& name, const SensorSink& sink) {
  const auto format = find_event_format(path, "");
  if (!format) return format.error();
  return (*format)->read_sensors != nullptr ? (*format)->read_sensors(path, name, sink) : Status{};
}

}  // namespace evpose
