// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// AEDAT 2.0 of DAVIS cameras. Rows count from the top, as everywhere here: the file counts from the bottom;
/// columns are as stored. The 32-bit clock's wraps are counted; smaller steps back are an error of order. The
/// image size is that of the camera which the header names. Errors: another camera, whose addresses mean
/// something else.
Expected<std::unique_ptr<EventReader>> open_events_aedat2(const std::string& path,
                                                          const EventReadOptions& options);

Expected<std::vector<StreamInfo>> list_aedat2_streams(const std::string& path);
/// IMU, in the sensor's own axes and scaled by the ranges in the header (8 g and 1000 deg/s where it is
/// silent), and external inputs as triggers. Frames, stored as readings of single pixels, are left out.
Status read_aedat2_sensors(const std::string& path, const SensorSink& sink);

bool starts_as_aedat2(std::string_view head);

}  // namespace evpose
