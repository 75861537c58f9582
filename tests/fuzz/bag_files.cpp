// SPDX-License-Identifier: BSD-3-Clause
// Bags, the messages in them, logs and trajectories.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "evpose/io/bag_messages.h"
#include "evpose/io/compression.h"
#include "evpose/io/event_messages.h"
#include "evpose/io/imu_text.h"
#include "evpose/io/trajectory.h"
#include "fuzz.h"

namespace {

using namespace evpose;

/// A name in the file system, on which SQLite insists; in memory, where there is such a place.
std::string make_name() {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path memory = "/dev/shm";
  const fs::path folder = fs::is_directory(memory, ignored) ? memory : fs::temp_directory_path();
  return (folder / ("evpose-fuzz-" + std::to_string(::getpid()) + ".db3")).string();
}

const std::string& named_file(fuzz::Bytes bytes) {
  static const std::string path = make_name();
  static const int registered = std::atexit([] { std::remove(path.c_str()); });
  EVPOSE_CHECK(registered == 0);
  std::FILE* file = std::fopen(path.c_str(), "wb");
  EVPOSE_CHECK(file != nullptr && std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size());
  EVPOSE_CHECK(std::fclose(file) == 0);
  return path;
}

constexpr const char* kTypes[] = {
    "dvs_msgs/EventArray",       "event_camera_msgs/EventPacket",  "sensor_msgs/Imu",  "sensor_msgs/Image",
    "geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped", "nav_msgs/Odometry"};

void read_events(const BagTopic& topic, const BagMessage& message) {
  const auto parsed = parse_event_message(topic, message, "message");
  if (!parsed) return;
  EventMessageDecoder decoder;
  decoder.begin(*parsed, "message");
  EventBlock block;
  std::vector<Trigger> triggers;
  while (true) {
    block.start();
    const auto all = decoder.decode(block, &triggers);
    if (!all || *all) return;
    EVPOSE_CHECK(block.count > 0);  // or it would never end
  }
}

}  // namespace

EVPOSE_FUZZ_TARGET(rosbag1) { evpose::fuzz::read_all(bytes, "rosbag1"); }
EVPOSE_FUZZ_TARGET(mcap) { evpose::fuzz::read_all(bytes, "mcap"); }
EVPOSE_FUZZ_TARGET(dataflash) { evpose::fuzz::read_all(bytes, "dataflash"); }

EVPOSE_FUZZ_TARGET(rosbag2_sqlite) {
  const std::string& path = named_file(bytes);
  evpose::fuzz::read_all_events(path, "rosbag2");
  evpose::fuzz::read_all_sensors(path, "rosbag2");
}

/// The first byte chooses the type and the wire.
EVPOSE_FUZZ_TARGET(bag_messages) {
  if (bytes.empty()) return;
  const BagTopic topic{"/t", kTypes[bytes[0] % std::size(kTypes)], bytes[0] < 128 ? Wire::ros1 : Wire::cdr,
                       "", 1};
  const BagMessage message{0, 0, std::as_bytes(bytes.subspan(1))};
  switch (kind_of_topic(topic)) {
    case StreamKind::events:
      return read_events(topic, message);
    case StreamKind::imu:
      static_cast<void>(parse_imu(topic, message, "message"));
      return;
    case StreamKind::frames:
      static_cast<void>(parse_image(topic, message, "message"));
      return;
    default:
      static_cast<void>(parse_pose(topic, message, "message"));
      return;
  }
}

/// The first byte chooses the method.
EVPOSE_FUZZ_TARGET(decompression) {
  if (bytes.empty()) return;
  constexpr Compression kMethods[] = {Compression::lz4, Compression::zstd, Compression::bz2};
  static std::vector<std::byte> room;
  static_cast<void>(
      decompress(kMethods[bytes[0] % 3], std::as_bytes(bytes.subspan(1)), 1 << 20, "block", room));
}

EVPOSE_FUZZ_TARGET(trajectory) {
  const auto poses = read_trajectory(evpose::fuzz::as_file(bytes));
  if (!poses) return;
  EVPOSE_CHECK(!poses->empty());
  for (std::size_t i = 0; i < poses->size(); ++i) {
    const TimedPose& pose = (*poses)[i];
    EVPOSE_CHECK(pose.pose.p.allFinite() && std::abs(pose.pose.q.norm() - 1) < 1e-9);
    EVPOSE_CHECK(i == 0 || pose.t > (*poses)[i - 1].t);
  }
}

EVPOSE_FUZZ_TARGET(imu_text) {
  const std::string path = evpose::fuzz::as_file(bytes);
  if (const auto options = recognise_imu_text(path)) static_cast<void>(read_imu_csv(path, *options));
}
