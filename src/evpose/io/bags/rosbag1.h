// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/bags/bag_reader.h"

namespace evpose {

/// First bytes of a ROS 1 bag 2.0.
inline constexpr std::string_view kRosbag1Magic = "#ROSBAG V2.0\n";

/// Kinds of records in a ROS 1 bag.
enum class Rosbag1Op : std::uint8_t {
  none = 0,
  message = 0x02,
  bag = 0x03,
  index = 0x04,
  chunk = 0x05,
  chunk_info = 0x06,
  connection = 0x07
};

/// A bag whose index is missing or damaged is read through once for its topics.
Expected<std::unique_ptr<BagReader>> open_rosbag1(const std::string& path);

}  // namespace evpose
