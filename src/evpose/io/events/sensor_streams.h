// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// An edge on the camera's trigger input, or a special event of the sensor.
struct Trigger {
  TimeNs t = 0;
  bool on = false;
  int id = 0;  ///< channel, or the kind of special event, as the file numbers it
};

/// A picture; `t` is what the file gives as its time (mid-exposure where it says so).
struct GreyFrame {
  TimeNs t = 0;
  int width = 0, height = 0, channels = 1;
  std::vector<std::uint8_t> pixels;  ///< row by row, channels interleaved; 16-bit sources scaled down
};

enum class StreamKind : std::uint8_t { events, imu, triggers, frames, poses, other };

/// One stream of a file: a topic of a bag, a stream of an AEDAT4 file, the only one of a RAW file.
struct StreamInfo {
  StreamKind kind = StreamKind::other;
  std::string name;            ///< topic or stream; "" where files have only one
  std::string type;            ///< message type or encoding, as the file names it
  std::int64_t messages = -1;  ///< packets or messages; -1: not known without reading all
};

/// What to do with each thing that is not an event; streams without a function are skipped, unread where the
/// format allows.
struct SensorSink {
  std::function<void(const ImuSample&)> imu;
  std::function<void(const Trigger&)> trigger;
  std::function<void(const GreyFrame&)> frame;
  std::function<void(const TimedPose&)> pose;
};

}  // namespace evpose
