// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/time.h"
#include "evpose/io/bags/message_reader.h"

namespace evpose {

struct BagTopic {
  std::string name;
  std::string type;  ///< "package/Type" for ROS 1 and ROS 2 alike
  Wire wire = Wire::other;
  std::string md5;             ///< of the type's definition; ROS 1 only
  std::int64_t messages = -1;  ///< -1: not known without reading all
};

struct BagMessage {
  std::size_t topic = 0;            ///< index into topics()
  TimeNs t = 0;                     ///< when the recorder received it
  std::span<const std::byte> data;  ///< holds until the reader's next call
};

/// Messages of a container in the order of the file, in bounded memory. A file that was cut off is read as
/// far as it is whole, with a warning. Errors: damaged data, with the byte where they stand.
class BagReader {
 public:
  virtual ~BagReader() = default;

  const std::vector<BagTopic>& topics() const { return topics_; }
  /// From now on next() gives messages of these topics only; before the first call it gives all.
  virtual Status select(const std::vector<std::size_t>& topics) = 0;
  /// False at the end.
  virtual Expected<bool> next(BagMessage& message) = 0;
  /// Back to the beginning.
  virtual Status rewind() = 0;
  /// To a place near the end, before the topic's last message; anywhere if it has none.
  virtual Status go_to_last(std::size_t topic) = 0;
  /// Fills in BagTopic::messages.
  virtual Status count_messages() = 0;

 protected:
  std::vector<BagTopic> topics_;
};

/// A ROS 1 bag 2.0, an MCAP file, a ROS 2 sqlite3 file or a ROS 2 bag folder, told apart by their content.
/// Errors: none of these, or its head is damaged.
Expected<std::unique_ptr<BagReader>> open_bag(const std::string& path);

/// Whether a file that begins so is one of these. Single storage files of ROS 2 bags are sqlite3 or MCAP; the
/// former, and both when compressed as a whole, count as rosbag2.
bool starts_as_rosbag1(std::string_view head);
bool starts_as_mcap(std::string_view head);
bool starts_as_rosbag2(std::string_view head);
/// A folder with metadata.yaml or with storage files.
bool is_rosbag2_folder(const std::string& path);
/// Whether open_bag() would take it for one of them; false as well where there is nothing.
bool is_bag(const std::string& path);

/// More than any message or chunk of a sound file, bytes.
inline constexpr std::size_t kLargestChunk = std::size_t{1} << 30;

}  // namespace evpose
