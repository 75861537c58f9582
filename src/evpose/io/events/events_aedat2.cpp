// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_aedat2.h"

#include <algorithm>
#include <array>
#include <numbers>

#include "evpose/core/log.h"
#include "evpose/io/events/event_source.h"
#include "evpose/io/files/byte_stream.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

constexpr std::size_t kRecord = 8;
constexpr std::size_t kPiece = kRecord * 8192;
constexpr std::int64_t kWrapUs = std::int64_t{1} << 32;
constexpr int kMostHeaderLines = 1'000'000;
constexpr double kStandardGravity = 9.80665;
constexpr double kRadians = std::numbers::pi / 180;
constexpr double kFullScale = 32768;  ///< counts of the 16-bit converter

constexpr std::uint32_t kNoEvent = 0x80000000, kExternal = 0x00000400, kImuMask = 0x80000C00;

struct Header {
  std::string chip;
  ImageSize size;
  double accel_range_g = 8, gyro_range_deg_s = 1000;
};

/// The number at the end of a value such as `value="ImuAccelScaleG8"/>`.
void read_range(std::string_view line, std::string_view key, std::string_view prefix, double& out) {
  if (line.find(key) == std::string_view::npos) return;
  const auto at = line.find(prefix);
  if (at == std::string_view::npos) return;
  const std::string_view digits = line.substr(at + prefix.size());
  std::int64_t value = 0;
  if (parse_integer(digits.substr(0, digits.find_first_not_of("0123456789")), value) && value > 0 &&
      value < 100'000)
    out = static_cast<double>(value);
}

ImageSize size_of(std::string_view chip) {
  const auto is = [&](const char* part) { return chip.find(part) != std::string_view::npos; };
  if (is("DAVIS240") || is("Davis240") || is("SBret10")) return {240, 180};
  if (is("DAVIS346") || is("Davis346")) return {346, 260};
  if (is("DAVIS640") || is("Davis640")) return {640, 480};
  if (is("DAVIS128") || is("Davis128") || is("DAVIS208") || is("Davis208"))
    return is("128") ? ImageSize{128, 128} : ImageSize{208, 192};
  return {};
}

/// Leaves the stream at the first record.
Expected<Header> read_header(ByteStream& bytes) {
  Header header;
  std::string line;
  int lines = 0;
  for (; lines < kMostHeaderLines && bytes.take_line("#", line); ++lines) {
    if (const auto at = line.find("AEChip: "); at != std::string::npos && header.chip.empty())
      header.chip = trimmed(std::string_view(line).substr(at + 8));
    read_range(line, "ImuAccelScale", "value=\"ImuAccelScaleG", header.accel_range_g);
    read_range(line, "ImuGyroScale", "value=\"GyroFullScaleDegPerSec", header.gyro_range_deg_s);
  }
  if (lines == 0)
    return Error{bytes.path(), "does not begin as an AEDAT 2 file", "name another events.format"};
  header.size = size_of(header.chip);
  if (header.size == ImageSize{})
    return Error{bytes.path(),
                 header.chip.empty() ? "the header names no camera (AEChip)" : "of the camera " + header.chip,
                 "only files of DAVIS cameras can be read"};
  return header;
}

struct Record {
  std::uint32_t address = 0;
  std::int64_t t_us = 0;
};

class Records {
 public:
  static Expected<Records> open(const std::string& path) {
    auto bytes = ByteStream::open(path);
    if (!bytes) return bytes.error();
    auto header = read_header(*bytes);
    if (!header) return header.error();
    return Records(*std::move(bytes), *std::move(header));
  }

  const Header& header() const { return header_; }
  const std::string& path() const { return bytes_.path(); }
  std::int64_t bytes_left() const { return bytes_.left(); }

  /// Records not yet taken; none at the end.
  std::size_t refill() {
    piece_ = bytes_.peek(kPiece);
    return std::min(piece_.size(), kPiece) / kRecord;
  }
  /// The i-th of these.
  Record at(std::size_t i) const {
    return {swapped(load<std::uint32_t>(piece_, i * kRecord)),
            wraps_us_ + swapped(load<std::uint32_t>(piece_, i * kRecord + 4))};
  }
  /// Takes the record: its time, wraps counted.
  std::int64_t advance(const Record& record) {
    std::int64_t t_us = record.t_us;
    if (last_us_ - t_us > kWrapUs / 2) {
      wraps_us_ += kWrapUs;
      t_us += kWrapUs;
    }
    last_us_ = t_us;
    return t_us;
  }
  void skip(std::size_t count) { bytes_.skip(count * kRecord); }

 private:
  Records(ByteStream bytes, Header header) : bytes_(std::move(bytes)), header_(std::move(header)) {}
  static std::uint32_t swapped(std::uint32_t v) {  // stored big-endian
    return v >> 24 | (v >> 8 & 0xFF00) | (v << 8 & 0xFF0000) | v << 24;
  }

  ByteStream bytes_;
  Header header_;
  std::span<const std::byte> piece_;
  std::int64_t wraps_us_ = 0, last_us_ = 0;
};

class Aedat2Source : public EventSource {
 public:
  static Expected<std::unique_ptr<EventSource>> open(const std::string& path) {
    auto records = Records::open(path);
    if (!records) return records.error();
    return std::unique_ptr<EventSource>(new Aedat2Source(*std::move(records)));
  }

  Expected<bool> fetch(EventBlock& block) override {
    block.start();
    const std::size_t count = records_.refill();
    if (count == 0) return false;
    const auto last_row = static_cast<std::uint32_t>(records_.header().size.height - 1);
    std::size_t i = 0;
    for (; i < count; ++i) {
      const Record record = records_.at(i);
      if ((record.address & (kNoEvent | kExternal)) != 0) continue;
      const std::int64_t t_us = records_.advance(record);
      if (block.count == 0) block.base_us = t_us;
      const std::int64_t dt = t_us - block.base_us;
      if (dt < 0 || dt > UINT32_MAX) break;  // the packer judges the first of a block by its own time
      const std::uint32_t row = record.address >> 22 & 0x1FF;
      // A row beyond the image must not come around to its other end.
      const std::uint32_t y = row <= last_row ? last_row - row : row;
      block.events[block.count++] = event_of_bits(event_bits(
          static_cast<std::uint32_t>(dt), record.address >> 12 & 0x3FF, y, record.address >> 11 & 1));
    }
    records_.skip(i);
    return true;
  }

  void finish() const override {
    if (records_.bytes_left() > 0)
      log_warning(text(records_.path(), ": ends within an event; the last ", records_.bytes_left(),
                       " bytes are left out"));
  }

 private:
  explicit Aedat2Source(Records records) : records_(std::move(records)) {}

  Records records_;
};

/// Seven words make a sample: acceleration, temperature, rate.
class ImuWords {
 public:
  explicit ImuWords(const Header& header)
      : accel_(header.accel_range_g / kFullScale * kStandardGravity),
        gyro_(header.gyro_range_deg_s / kFullScale * kRadians) {}

  void take(std::uint32_t address, std::int64_t t_us, const SensorSink& sink) {
    const std::size_t kind = address >> 28 & 7;
    if (kind != wanted_) {  // words are missing: wait for the next sample's first
      wanted_ = 0;
      if (kind != 0) return;
    }
    values_[kind] = static_cast<std::int16_t>(address >> 12 & 0xFFFF);
    wanted_ = (kind + 1) % values_.size();
    if (wanted_ != 0) return;
    ImuSample sample;
    sample.t = t_us * kNsPerUs;
    sample.accel = accel_ * Eigen::Vector3d(values_[0], values_[1], values_[2]);
    sample.gyro = gyro_ * Eigen::Vector3d(values_[4], values_[5], values_[6]);
    sink.imu(sample);
  }

 private:
  double accel_, gyro_;
  std::size_t wanted_ = 0;
  std::array<std::int16_t, 7> values_{};
};

}  // namespace

bool starts_as_aedat2(std::string_view head) { return head.starts_with("#!AER-DAT2"); }

Expected<std::unique_ptr<EventReader>> open_events_aedat2(const std::string& path,
                                                          const EventReadOptions& options) {
  const auto records = Records::open(path);
  if (!records) return records.error();
  return make_event_reader(path, options, records->header().size,
                           [path] { return Aedat2Source::open(path); });
}

Expected<std::vector<StreamInfo>> list_aedat2_streams(const std::string& path) {
  const auto records = Records::open(path);
  if (!records) return records.error();
  const std::string& chip = records->header().chip;
  return std::vector<StreamInfo>{{StreamKind::events, "events", chip, -1},
                                 {StreamKind::imu, "imu", chip, -1},
                                 {StreamKind::triggers, "triggers", chip, -1}};
}

Status read_aedat2_sensors(const std::string& path, const SensorSink& sink) {
  if (!sink.imu && !sink.trigger) return {};
  auto records = Records::open(path);
  if (!records) return records.error();
  ImuWords imu(records->header());
  while (const std::size_t count = records->refill()) {
    for (std::size_t i = 0; i < count; ++i) {
      const Record record = records->at(i);
      const std::int64_t t_us = records->advance(record);
      if (sink.imu && (record.address & kImuMask) == kImuMask) imu.take(record.address, t_us, sink);
      if (sink.trigger && (record.address & (kNoEvent | kExternal)) == kExternal)
        sink.trigger({t_us * kNsPerUs, (record.address >> 11 & 1) != 0, 0});
    }
    records->skip(count);
  }
  return {};
}

}  // namespace evpose
