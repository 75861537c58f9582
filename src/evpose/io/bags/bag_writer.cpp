// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/bag_writer.h"

#include <array>
#include <limits>
#include <optional>

#include "evpose/io/bags/bag_container_writer.h"
#include "evpose/io/bags/message_writer.h"

namespace evpose {
namespace {

constexpr std::int64_t kMessageUs = 10'000;
constexpr std::size_t kMostEvents = 1 << 16;      // of a message
constexpr std::array<double, 9> kUnknown = {-1};  // "not provided"
constexpr std::array<double, 9> kNoCovariance = {};

std::int64_t floor_us(TimeNs t) { return t / kNsPerUs - (t % kNsPerUs < 0 ? 1 : 0); }

struct FullEvent {
  std::int64_t t_us;
  std::uint16_t x, y;
  bool on;
};

/// A topic that comes into being with its first message.
struct Topic {
  std::string name, type, frame;
  std::optional<std::size_t> number = {};
  std::uint32_t messages = 0;
};

std::string format_of(const std::string& path, const std::string& format) {
  if (!format.empty()) return format;
  return path.ends_with(".bag") ? "rosbag1" : path.ends_with(".mcap") ? "mcap" : "";
}

}  // namespace

struct BagWriter::Impl {
  std::string path;
  ImageSize size;
  std::unique_ptr<BagContainerWriter> container;
  Topic events, imu, poses;
  bool packets = false;
  std::vector<FullEvent> pending;
  std::int64_t last_us = std::numeric_limits<std::int64_t>::min();
  MessageWriter message;

  Status check_time(TimeNs t) const;
  void begin(const Topic& topic, TimeNs stamp);
  void write(Topic& topic, TimeNs t) const;
  void flush();
  void put_array();
  void put_packet();
};

Status BagWriter::Impl::check_time(TimeNs t) const {
  if (t >= 0 && t < message_time_end(container->wire())) return {};
  return Error{
      path, text("a stamp of ", to_seconds(t), " s cannot be written: ROS counts from 1970 on, in 32 bits"),
      "shift the stamps, or write another format"};
}

void BagWriter::Impl::begin(const Topic& topic, TimeNs stamp) {
  message.clear();
  if (container->wire() == Wire::ros1) message.u32(topic.messages);
  message.time(stamp);
  message.string(topic.frame);
}

void BagWriter::Impl::write(Topic& topic, TimeNs t) const {
  if (!topic.number) topic.number = container->add_topic(topic.name, topic.type);
  container->write(*topic.number, t, message.data());
  ++topic.messages;
}

void BagWriter::Impl::put_array() {
  message.u32(static_cast<std::uint32_t>(pending.size()));
  for (const FullEvent& e : pending) {
    message.u16(e.x);
    message.u16(e.y);
    message.time(e.t_us * kNsPerUs);
    message.u8(e.on ? 1 : 0);
  }
}

void BagWriter::Impl::put_packet() {
  const TimeNs base = pending.front().t_us * kNsPerUs;
  MessageWriter words;
  for (const FullEvent& e : pending) {
    const auto dt = static_cast<std::uint64_t>(e.t_us * kNsPerUs - base);
    words.u64(dt | std::uint64_t{e.x} << 32 | std::uint64_t{e.y} << 48 | std::uint64_t{e.on} << 63);
  }
  message.u64(events.messages);
  message.u64(static_cast<std::uint64_t>(base));
  message.string("mono");
  message.u8(0);  // little-endian
  message.byte_sequence(words.data());
}

/// Pending events become a message, stamped with the first of them.
void BagWriter::Impl::flush() {
  if (pending.empty()) return;
  begin(events, pending.front().t_us * kNsPerUs);
  message.u32(static_cast<std::uint32_t>(size.height));
  message.u32(static_cast<std::uint32_t>(size.width));
  packets ? put_packet() : put_array();
  write(events, pending.front().t_us * kNsPerUs);
  pending.clear();
}

BagWriter::BagWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BagWriter::BagWriter(BagWriter&& other) noexcept = default;
BagWriter& BagWriter::operator=(BagWriter&& other) noexcept = default;
BagWriter::~BagWriter() = default;

Expected<BagWriter> BagWriter::create(const std::string& path, ImageSize size,
                                      const BagWriteOptions& options) {
  const std::string format = format_of(path, options.format);
  if (format != "rosbag1" && format != "mcap")
    return Error{path,
                 format.empty() ? "its extension names no bag" : "bags cannot be written as '" + format + "'",
                 "use .bag or .mcap"};
  const bool is_mcap = format == "mcap";
  if (options.compression == Compression::bz2 || (!is_mcap && options.compression == Compression::zstd))
    return Error{path, "cannot be written with that compression", "use none or lz4, in MCAP also zstd"};
  auto container =
      is_mcap ? create_mcap(path, options.compression) : create_rosbag1(path, options.compression);
  if (!container) return container.error();
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  impl->size = size;
  impl->container = *std::move(container);
  impl->message = MessageWriter(impl->container->wire());
  impl->packets = options.event_packets;
  impl->events = {options.events_topic,
                  options.event_packets ? "event_camera_msgs/EventPacket" : "dvs_msgs/EventArray",
                  options.events_frame};
  impl->imu = {options.imu_topic, "sensor_msgs/Imu", options.imu_frame};
  impl->poses = {options.pose_topic, "geometry_msgs/PoseStamped", options.pose_frame};
  return BagWriter(std::move(impl));
}

Status BagWriter::append(const EventPacket& packet) {
  Impl& m = *impl_;
  if (packet.empty()) return {};
  for (const TimeNs t : {packet.time(packet.events.front()), packet.time(packet.events.back())})
    if (auto status = m.check_time(t); !status) return status;
  for (const Event& e : packet.events) {
    const std::int64_t us = floor_us(packet.time(e));
    EVPOSE_CHECK(us >= m.last_us && e.x < m.size.width && e.y < m.size.height);
    m.last_us = us;
    const bool full = !m.pending.empty() && (us / kMessageUs != m.pending.front().t_us / kMessageUs ||
                                             m.pending.size() >= kMostEvents);
    if (full) m.flush();
    m.pending.push_back({us, e.x, e.y, e.on != 0});
  }
  return {};
}

Status BagWriter::append(const ImuSample& sample) {
  Impl& m = *impl_;
  EVPOSE_CHECK(sample.gyro.allFinite() && sample.accel.allFinite());
  if (auto status = m.check_time(sample.t); !status) return status;
  m.begin(m.imu, sample.t);
  m.message.numbers(std::array<double, 4>{0, 0, 0, 1});
  m.message.numbers(kUnknown);
  m.message.numbers({sample.gyro.data(), 3});
  m.message.numbers(kNoCovariance);
  m.message.numbers({sample.accel.data(), 3});
  m.message.numbers(kNoCovariance);
  m.write(m.imu, sample.t);
  return {};
}

Status BagWriter::append(const TimedPose& pose) {
  Impl& m = *impl_;
  EVPOSE_CHECK(pose.pose.p.allFinite() && pose.pose.q.coeffs().allFinite());
  if (auto status = m.check_time(pose.t); !status) return status;
  m.begin(m.poses, pose.t);
  m.message.numbers({pose.pose.p.data(), 3});
  m.message.numbers({pose.pose.q.coeffs().data(), 4});  // x y z w
  m.write(m.poses, pose.t);
  return {};
}

Status BagWriter::finish() {
  impl_->flush();
  return impl_->container->finish();
}

}  // namespace evpose
