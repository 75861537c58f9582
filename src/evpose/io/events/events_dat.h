// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// Prophesee DAT, versions 1 and 2, of events. Its clock has 32 bits; wraps are counted. Errors: a file of
/// triggers, another event type or size, no events.
Expected<std::unique_ptr<EventReader>> open_events_dat(const std::string& path,
                                                       const EventReadOptions& options);

Expected<std::vector<StreamInfo>> list_dat_streams(const std::string& path);
/// Triggers, of a file that holds these.
Status read_dat_sensors(const std::string& path, const SensorSink& sink);

/// Whether a file begins with the header of such a file, and the two bytes that follow it.
bool starts_as_dat(std::string_view head);

}  // namespace evpose
