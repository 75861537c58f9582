// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// Bags of ROS 1 and ROS 2 and MCAP files, as open_bag() tells them apart; without a ROS installation. A file
/// that was cut off is read as far as it is whole, with a warning.

/// Events of dvs_msgs and prophesee_event_msgs EventArray and of event_camera_msgs EventPacket. Stamps of
/// packets encoded as evt3 are the sensor's own, of all others those of the recorder's clock. Errors: no such
/// topic, no events, a changed message definition, damaged data.
Expected<std::unique_ptr<EventReader>> open_events_bag(const std::string& path,
                                                       const EventReadOptions& options);

/// One stream for each topic, also those of kind other, which nothing here can read.
Expected<std::vector<StreamInfo>> list_bag_streams(const std::string& path);

/// As read_sensors(). Stamps are those of the messages' headers; the order is that of the file. Triggers are
/// found in the packets of an event topic.
Status read_bag_sensors(const std::string& path, const std::string& name, const SensorSink& sink);

}  // namespace evpose
