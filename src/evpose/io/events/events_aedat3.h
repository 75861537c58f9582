// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// AEDAT 3.1: packets of polarity events; others are skipped. The file does not say the image size. Errors:
/// a packet whose header cannot be; steps back in time.
Expected<std::unique_ptr<EventReader>> open_events_aedat3(const std::string& path,
                                                          const EventReadOptions& options);

Expected<std::vector<StreamInfo>> list_aedat3_streams(const std::string& path);
/// IMU (of 6 and 9 axes), and the edges of the external input as triggers.
Status read_aedat3_sensors(const std::string& path, const SensorSink& sink);

bool starts_as_aedat3(std::string_view head);

}  // namespace evpose
