// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/bag_reader.h"

#include <filesystem>

#include "evpose/io/bags/mcap.h"
#include "evpose/io/bags/rosbag1.h"
#include "evpose/io/bags/rosbag2.h"
#include "evpose/io/files/input_file.h"

namespace evpose {
namespace {

constexpr std::size_t kBagHeadBytes = 16;  // more than the longest of the magics
constexpr std::string_view kZstdMagic = "\x28\xB5\x2F\xFD";

bool starts_as_sqlite(std::string_view head) {
  return head.starts_with(std::string_view("SQLite format 3\0", 16));
}

}  // namespace

bool starts_as_rosbag1(std::string_view head) { return head.starts_with("#ROSBAG V"); }

bool starts_as_mcap(std::string_view head) {
  return head.starts_with({reinterpret_cast<const char*>(kMcapMagic.data()), kMcapMagic.size()});
}

bool starts_as_rosbag2(std::string_view head) {
  return starts_as_sqlite(head) || head.starts_with(kZstdMagic);
}

bool is_rosbag2_storage(std::string_view name) {
  for (const std::string_view ending : {".db3", ".mcap", ".db3.zstd", ".mcap.zstd"})
    if (name.ends_with(ending)) return true;
  return false;
}

bool is_rosbag2_folder(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return false;
  if (fs::is_regular_file(fs::path(path) / "metadata.yaml", ignored)) return true;
  for (const auto& entry : fs::directory_iterator(path, ignored))
    if (is_rosbag2_storage(entry.path().filename().string())) return true;
  return false;
}

bool is_bag(const std::string& path) {
  if (is_rosbag2_folder(path)) return true;
  const auto head = first_bytes(path, kBagHeadBytes);
  return head && (starts_as_rosbag1(*head) || starts_as_mcap(*head) || starts_as_rosbag2(*head));
}

Expected<std::unique_ptr<BagReader>> open_bag(const std::string& path) {
  if (is_rosbag2_folder(path)) return open_rosbag2_folder(path);
  const auto head = first_bytes(path, kBagHeadBytes);
  if (!head) return head.error();
  if (starts_as_rosbag1(*head)) return open_rosbag1(path);
  if (starts_as_mcap(*head)) return open_mcap(path);
  if (starts_as_sqlite(*head)) return open_rosbag2_sqlite(path, false);
  if (starts_as_rosbag2(*head)) return open_rosbag2_zstd(path);
  return Error{path, "is neither a ROS 1 bag, a ROS 2 bag nor an MCAP file", "check the path"};
}

}  // namespace evpose
