// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/files/compression.h"

namespace evpose {

/// Puts messages into a container, chunk by chunk, indexed. Nothing stands at its path before finish().
class BagContainerWriter {
 public:
  virtual ~BagContainerWriter() = default;

  virtual Wire wire() const = 0;
  /// `type`: one that message_definition() knows. Returns the topic's number.
  virtual std::size_t add_topic(const std::string& name, const std::string& type) = 0;
  /// `t` in the range that messages can carry.
  virtual void write(std::size_t topic, TimeNs t, std::span<const std::byte> message) = 0;
  /// Errors: writing failed.
  virtual Status finish() = 0;
};

/// ROS 1 bag 2.0; compression none or lz4.
Expected<std::unique_ptr<BagContainerWriter>> create_rosbag1(const std::string& path,
                                                             Compression compression);
/// MCAP with the profile of ROS 2; compression none, lz4 or zstd.
Expected<std::unique_ptr<BagContainerWriter>> create_mcap(const std::string& path, Compression compression);

}  // namespace evpose
