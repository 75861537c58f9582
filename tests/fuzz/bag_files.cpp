// SPDX-License-Identifier: BSD-3-Clause
// Bags, the messages in them, logs and trajectories.
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "evpose/io/bags/bag_messages.h"
#include "evpose/io/bags/event_messages.h"
#include "evpose/io/files/compression.h"
#include "evpose/io/motion/imu_text.h"
#include "evpose/io/motion/trajectory.h"
#include "fuzz.h"

namespace {

using namespace evpose;

/// The input as SQLite opens it: a file system that holds this one file, to be read.
class OneFile {
 public:
  static void hold(fuzz::Bytes bytes) {
    static const int registered = sqlite3_vfs_register(system(), 1);
    EVPOSE_CHECK(registered == SQLITE_OK);
    content_ = bytes;
  }

 private:
  static sqlite3_vfs* system() {
    static sqlite3_vfs made = *sqlite3_vfs_find(nullptr);
    made.zName = "one-file";
    made.szOsFile = sizeof(sqlite3_file);
    made.mxPathname = 100;
    made.xOpen = [](sqlite3_vfs*, sqlite3_filename, sqlite3_file* file, int flags, int* out_flags) {
      file->pMethods = (flags & SQLITE_OPEN_MAIN_DB) != 0 ? methods() : nullptr;
      if (out_flags != nullptr) *out_flags = flags;
      return file->pMethods != nullptr ? SQLITE_OK : SQLITE_CANTOPEN;
    };
    made.xDelete = [](sqlite3_vfs*, const char*, int) { return SQLITE_IOERR; };
    made.xAccess = [](sqlite3_vfs*, const char*, int, int* found) { return *found = 0, SQLITE_OK; };
    made.xFullPathname = [](sqlite3_vfs*, const char* name, int room, char* out) {
      sqlite3_snprintf(room, out, "%s", name);
      return SQLITE_OK;
    };
    return &made;
  }

  static const sqlite3_io_methods* methods() {
    static sqlite3_io_methods made{};
    made.iVersion = 1;
    made.xClose = [](sqlite3_file*) { return SQLITE_OK; };
    made.xRead = [](sqlite3_file*, void* out, int count, sqlite3_int64 at) {
      const auto size = static_cast<sqlite3_int64>(content_.size());
      const sqlite3_int64 there = std::clamp<sqlite3_int64>(size - at, 0, count);
      if (there > 0) std::memcpy(out, content_.data() + at, static_cast<std::size_t>(there));
      std::memset(static_cast<char*>(out) + there, 0, static_cast<std::size_t>(count - there));
      return there == count ? SQLITE_OK : SQLITE_IOERR_SHORT_READ;
    };
    made.xWrite = [](sqlite3_file*, const void*, int, sqlite3_int64) { return SQLITE_READONLY; };
    made.xTruncate = [](sqlite3_file*, sqlite3_int64) { return SQLITE_READONLY; };
    made.xSync = [](sqlite3_file*, int) { return SQLITE_OK; };
    made.xFileSize = [](sqlite3_file*, sqlite3_int64* size) {
      return *size = static_cast<sqlite3_int64>(content_.size()), SQLITE_OK;
    };
    made.xLock = made.xUnlock = [](sqlite3_file*, int) { return SQLITE_OK; };
    made.xCheckReservedLock = [](sqlite3_file*, int* held) { return *held = 0, SQLITE_OK; };
    made.xFileControl = [](sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; };
    made.xSectorSize = made.xDeviceCharacteristics = [](sqlite3_file*) { return 0; };
    return &made;
  }

  static inline fuzz::Bytes content_;
};

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
  OneFile::hold(bytes);
  evpose::fuzz::read_all(bytes, "rosbag2");
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
