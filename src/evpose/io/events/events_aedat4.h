// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// AEDAT 4.0, uncompressed, LZ4 or Zstandard. The file is walked packet by packet, its table of packets is
/// not used: some writers leave it empty, and interrupted recordings have none. A packet that is cut off ends
/// the file, with a warning. `options.topic` picks a stream of events by the number in its file; empty: the
/// first. Errors: no such stream, a packet that is damaged.
Expected<std::unique_ptr<EventReader>> open_events_aedat4(const std::string& path,
                                                          const EventReadOptions& options);

Expected<std::vector<StreamInfo>> list_aedat4_streams(const std::string& path);
/// IMU, frames and triggers; the id of a trigger is its kind as the file numbers it (1 rising, 2 falling, 3
/// pulse, 6 to 9 begin and end of frame and exposure). A frame's time is mid-exposure where it has one.
Status read_aedat4_sensors(const std::string& path, const std::string& name, const SensorSink& sink);

bool starts_as_aedat4(std::string_view head);

}  // namespace evpose
