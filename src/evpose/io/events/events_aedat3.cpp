// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_aedat3.h"

#include <algorithm>
#include <map>
#include <numbers>

#include "evpose/core/log.h"
#include "evpose/io/events/event_packer.h"
#include "evpose/io/events/event_source.h"
#include "evpose/io/files/byte_stream.h"

namespace evpose {
namespace {

constexpr std::size_t kPacketHead = 28;
constexpr int kMostHeaderLines = 100'000;
constexpr std::int64_t kLargestPacket = 256 << 20;
constexpr double kStandardGravity = 9.80665;
constexpr double kRadians = std::numbers::pi / 180;

enum Type : int { kSpecial = 0, kPolarity = 1, kFrame = 2, kImu6 = 3, kImu9 = 4 };
/// Kinds of special events: edges of the external input.
enum Special : unsigned { kRising = 2, kFalling = 3, kPulse = 4 };

/// Bytes that an event of the type has at least.
std::size_t least_bytes(int type) { return type == kImu6 || type == kImu9 ? 36 : 8; }

class Packets {
 public:
  static Expected<Packets> open(const std::string& path) {
    auto bytes = ByteStream::open(path);
    if (!bytes) return bytes.error();
    std::string line;
    for (int lines = 0; lines < kMostHeaderLines && bytes->take_line("#", line); ++lines)
      if (line == "#!END-HEADER") return Packets(*std::move(bytes));
    return Error{path, "the header of the AEDAT 3 file has no end", "copy the file again"};
  }

  /// Goes to the next packet; false at the end, also where the last packet is cut off.
  Expected<bool> next() {
    bytes_.skip(payload_);
    payload_ = 0;
    const auto head = bytes_.peek(kPacketHead);
    cut_ = !head.empty();
    if (head.size() < kPacketHead) return false;
    type_ = load<std::int16_t>(head);
    const auto item = load<std::int32_t>(head, 4), number = load<std::int32_t>(head, 20);
    overflow_us_ = static_cast<std::int64_t>(load<std::int32_t>(head, 12)) << 31;
    const std::int64_t bytes = static_cast<std::int64_t>(item) * number;
    const Error damaged{path(), text("byte ", bytes_.position(), ": the packet's header cannot be"),
                        "the file is damaged; copy it again"};
    if (type_ < 0 || type_ > 127 || item <= 0 || number < 0 || overflow_us_ < 0 ||
        overflow_us_ > kLargestTimeUs || bytes > kLargestPacket)
      return damaged;
    if (type_ != kFrame && static_cast<std::size_t>(item) < least_bytes(type_)) return damaged;
    if (bytes > bytes_.left() - static_cast<std::int64_t>(kPacketHead)) return false;
    bytes_.skip(kPacketHead);
    payload_ = static_cast<std::size_t>(bytes);
    item_ = static_cast<std::size_t>(item);
    cut_ = false;
    return true;
  }

  int type() const { return type_; }
  std::size_t item() const { return item_; }  ///< bytes of one event
  std::span<const std::byte> payload() {
    const auto bytes = bytes_.peek(payload_);
    return bytes.first(std::min(payload_, bytes.size()));
  }
  std::int64_t time_us(std::span<const std::byte> event) const {
    return overflow_us_ + load<std::int32_t>(event, 4);
  }
  const std::string& path() const { return bytes_.path(); }
  void warn_if_cut() const {
    if (cut_) log_warning(path() + ": ends within a packet, which is left out");
  }

 private:
  explicit Packets(ByteStream bytes) : bytes_(std::move(bytes)) {}

  ByteStream bytes_;
  int type_ = 0;
  std::size_t item_ = 0, payload_ = 0;
  std::int64_t overflow_us_ = 0;
  bool cut_ = false;
};

class Aedat3Source : public EventSource {
 public:
  static Expected<std::unique_ptr<EventSource>> open(const std::string& path) {
    auto packets = Packets::open(path);
    if (!packets) return packets.error();
    return std::unique_ptr<EventSource>(new Aedat3Source(*std::move(packets)));
  }

  Expected<bool> fetch(EventBlock& block) override {
    block.start();
    while (rest_.empty()) {
      const auto more = packets_.next();
      if (!more) return more.error();
      if (!*more) return false;
      if (packets_.type() == kPolarity) rest_ = packets_.payload();
    }
    const std::size_t item = packets_.item();
    while (rest_.size() >= item && block.count < block.events.size()) {
      const auto data = load<std::uint32_t>(rest_);
      const std::int64_t t_us = packets_.time_us(rest_);
      if (block.count == 0) block.base_us = t_us;
      const std::int64_t dt = t_us - block.base_us;
      if (dt < 0 || dt > UINT32_MAX) return true;  // the packer judges the first of a block by its own time
      block.events[block.count] = event_of_bits(
          event_bits(static_cast<std::uint32_t>(dt), data >> 17, data >> 2 & 0x7FFF, data >> 1 & 1));
      block.count += data & 1;
      rest_ = rest_.subspan(item);
    }
    if (rest_.size() < item) rest_ = {};
    return true;
  }

  void finish() const override { packets_.warn_if_cut(); }

 private:
  explicit Aedat3Source(Packets packets) : packets_(std::move(packets)) {}

  Packets packets_;
  std::span<const std::byte> rest_;  ///< of the packet at hand
};

void give(const Packets& packets, std::span<const std::byte> event, const SensorSink& sink) {
  const auto info = load<std::uint32_t>(event);
  if ((info & 1) == 0) return;
  const TimeNs t = packets.time_us(event) * kNsPerUs;
  if (packets.type() == kSpecial) {
    const unsigned kind = info >> 1 & 0x7F;
    if (sink.trigger && (kind == kRising || kind == kFalling || kind == kPulse))
      sink.trigger({t, kind != kFalling, static_cast<int>(kind)});
  } else if (sink.imu) {
    const auto vector = [&](std::size_t at) {
      return Eigen::Vector3d(load<float>(event, at), load<float>(event, at + 4), load<float>(event, at + 8));
    };
    ImuSample sample;
    sample.t = t;
    sample.accel = kStandardGravity * vector(8);
    sample.gyro = kRadians * vector(20);
    sink.imu(sample);
  }
}

}  // namespace

bool starts_as_aedat3(std::string_view head) { return head.starts_with("#!AER-DAT3"); }

Expected<std::unique_ptr<EventReader>> open_events_aedat3(const std::string& path,
                                                          const EventReadOptions& options) {
  return make_event_reader(path, options, {}, [path] { return Aedat3Source::open(path); });
}

Expected<std::vector<StreamInfo>> list_aedat3_streams(const std::string& path) {
  auto packets = Packets::open(path);
  if (!packets) return packets.error();
  std::map<int, std::int64_t> counts;
  while (true) {
    const auto more = packets->next();
    if (!more) return more.error();
    if (!*more) break;
    ++counts[packets->type()];
  }
  std::vector<StreamInfo> infos;
  for (const auto& [type, count] : counts) {
    switch (type) {
      case kSpecial:
        infos.push_back({StreamKind::triggers, "special", "special", count});
        break;
      case kPolarity:
        infos.push_back({StreamKind::events, "polarity", "polarity", count});
        break;
      case kImu6:
      case kImu9:
        infos.push_back(
            {StreamKind::imu, type == kImu6 ? "imu6" : "imu9", type == kImu6 ? "IMU6" : "IMU9", count});
        break;
      default:
        infos.push_back({StreamKind::other, text("type ", type), text(type), count});
    }
  }
  return infos;
}

Status read_aedat3_sensors(const std::string& path, const SensorSink& sink) {
  auto packets = Packets::open(path);
  if (!packets) return packets.error();
  while (true) {
    const auto more = packets->next();
    if (!more) return more.error();
    if (!*more) return {};
    if (packets->type() != kSpecial && packets->type() != kImu6 && packets->type() != kImu9) continue;
    for (auto rest = packets->payload(); rest.size() >= packets->item(); rest = rest.subspan(packets->item()))
      give(*packets, rest, sink);
  }
}

}  // namespace evpose
