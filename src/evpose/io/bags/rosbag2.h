// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "evpose/io/bags/bag_reader.h"

namespace evpose {

/// Whether a file's name ends as those that a ROS 2 bag consists of.
bool is_rosbag2_storage(std::string_view name);

/// One sqlite3 storage file. `messages_are_zstd`: each is one Zstandard frame (compression_mode MESSAGE).
Expected<std::unique_ptr<BagReader>> open_rosbag2_sqlite(const std::string& path, bool messages_are_zstd);

/// A folder with metadata.yaml, or, without it, with .db3 or .mcap files: the files one after another.
Expected<std::unique_ptr<BagReader>> open_rosbag2_folder(const std::string& path);

/// A storage file as a whole compressed with Zstandard (compression_mode FILE); unpacked into a
/// temporary file.
Expected<std::unique_ptr<BagReader>> open_rosbag2_zstd(const std::string& path);

}  // namespace evpose
