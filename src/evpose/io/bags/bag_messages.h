// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// What a topic holds, by its type: events; sensor_msgs/Imu; sensor_msgs/Image; poses (geometry_msgs
/// PoseStamped, PoseWithCovarianceStamped, TransformStamped, nav_msgs/Odometry). Other for what is not read.
StreamKind kind_of_topic(const BagTopic& topic);

/// Error if the bag's definition of the type is another than ours, told by its MD5.
Status check_definition(const BagTopic& topic, const std::string& where);

/// The functions below read a message of the kind. Stamps are those of the header. Errors, at `where`: cut
/// off, not finite, no rotation, an encoding of images that is not known.
Expected<ImuSample> parse_imu(const BagTopic& topic, const BagMessage& message, const std::string& where);
/// For a transform: the pose of the child in the frame of the header.
Expected<TimedPose> parse_pose(const BagTopic& topic, const BagMessage& message, const std::string& where);
/// Colours come as red, green, blue.
Expected<GreyFrame> parse_image(const BagTopic& topic, const BagMessage& message, const std::string& where);

}  // namespace evpose
