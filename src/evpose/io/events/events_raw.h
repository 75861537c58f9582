// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// Prophesee RAW: EVT2, EVT2.1 in both orders of its halves, EVT3. The image size is that of the header, or
/// of the sensor that it names. Times are the sensor's own, unshifted, so that events and triggers agree.
/// Errors: an encoding other than these, no events.
Expected<std::unique_ptr<EventReader>> open_events_raw(const std::string& path,
                                                       const EventReadOptions& options);

Expected<std::vector<StreamInfo>> list_raw_streams(const std::string& path);
/// Triggers.
Status read_raw_sensors(const std::string& path, const SensorSink& sink);

/// Whether a file begins with the header of such a file.
bool starts_as_raw(std::string_view head);

}  // namespace evpose
