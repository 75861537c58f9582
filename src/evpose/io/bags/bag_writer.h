// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"
#include "evpose/io/events/event_writer.h"
#include "evpose/io/files/compression.h"

namespace evpose {

struct BagWriteOptions {
  std::string format;  ///< "rosbag1" or "mcap"; empty: by the extension, .bag or .mcap
  Compression compression = Compression::lz4;  ///< of chunks: none or lz4, in MCAP also zstd
  /// Events as event_camera_msgs/EventPacket, encoding mono, instead of as dvs_msgs/EventArray: half the
  /// size.
  bool event_packets = false;
  std::string events_topic = "/events", imu_topic = "/imu", pose_topic = "/pose";
  std::string events_frame = "camera", imu_frame = "imu", pose_frame = "map";
};

/// Writes a bag of ROS 1, or MCAP as ROS 2 has it, of events, IMU samples (sensor_msgs/Imu) and poses
/// (geometry_msgs/PoseStamped). A topic is there once something was appended to it. Messages stand in the
/// order of the appends; events are gathered to messages of up to 10 ms. Stamps before 1970, or too late
/// for ROS (2106, in ROS 2 2038), are errors.
class BagWriter : public EventWriter {
 public:
  static Expected<BagWriter> create(const std::string& path, ImageSize size,
                                    const BagWriteOptions& options = {});
  BagWriter(BagWriter&& other) noexcept;
  BagWriter& operator=(BagWriter&& other) noexcept;
  ~BagWriter() override;

  /// Stamps are rounded down to microseconds.
  Status append(const EventPacket& packet) override;
  Status append(const ImuSample& sample);
  Status append(const TimedPose& pose);
  Status finish() override;

 private:
  struct Impl;
  explicit BagWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose
