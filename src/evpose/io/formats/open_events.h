// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// `format`: a name of event_formats.h, such as "h5", "raw" or "text"; or empty: by the file's first bytes,
/// then its extension. Errors: no such file, not that format, truncated, a filter that is not installed, no
/// events, unknown time unit.
Expected<std::unique_ptr<EventReader>> open_events(const std::string& path, const std::string& format,
                                                   const EventReadOptions& options);

/// Streams in a file of any format that open_events() or read_sensors() knows, in the file's order. Errors:
/// unknown format, damaged header.
Expected<std::vector<StreamInfo>> list_streams(const std::string& path);

/// Reads once through a file and hands over what is not an event, in SI units and on the clock of the file's
/// events. `name` picks a stream; "": the first of each kind. A file without such streams hands over nothing.
/// Errors: as for events.
Status read_sensors(const std::string& path, const std::string& name, const SensorSink& sink);

}  // namespace evpose
