// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/sensor_streams.h"

#include "evpose/io/event_formats.h"

namespace evpose {

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
