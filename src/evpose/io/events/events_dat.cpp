// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_dat.h"

#include <algorithm>

#include "evpose/core/log.h"
#include "evpose/io/events/decode_faults.h"
#include "evpose/io/events/event_source.h"
#include "evpose/io/files/byte_stream.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

constexpr std::size_t kRecord = 8;
constexpr std::size_t kPiece = kRecord * 8192;
constexpr unsigned kEvent2d = 0x00, kChange = 0x0C, kExternalTrigger = 0x0E;
constexpr std::int64_t kWrapUs = std::int64_t{1} << 32;
constexpr std::int64_t kHiccupUs = 10 * 4096;  // as of the RAW formats
constexpr int kMostHeaderLines = 1000;

struct Header {
  unsigned type = 0;
  bool version_1 = true;
  ImageSize size;
};

bool is_type(unsigned type) { return type == kEvent2d || type == kChange || type == kExternalTrigger; }

bool value_of(std::string_view line, std::string_view key, std::int64_t& out) {
  line = trimmed(line.substr(1));
  return line.starts_with(key) && parse_integer(trimmed(line.substr(key.size())), out);
}

/// Leaves the stream at the first record.
Expected<Header> read_header(ByteStream& bytes) {
  const std::string& path = bytes.path();
  Header header;
  std::int64_t version = 1, width = 0, height = 0;
  std::string line;
  int lines = 0;
  for (; lines < kMostHeaderLines && bytes.take_line("%", line); ++lines) {
    value_of(line, "Version", version) || value_of(line, "Width", width) || value_of(line, "Height", height);
    if (trimmed(line) == "% end") break;
  }
  if (lines == 0 || lines == kMostHeaderLines)
    return Error{path, "does not begin with the header of a DAT file", "is it a Prophesee DAT file?"};
  const auto kind = bytes.peek(2);
  if (kind.size() < 2) return Error{path, "ends within its header", "copy the file again"};
  header.type = std::to_integer<unsigned>(kind[0]);
  const auto record = std::to_integer<unsigned>(kind[1]);
  if (!is_type(header.type) || record != kRecord)
    return Error{path, text("holds records of type ", header.type, " and ", record, " bytes"),
                 "only events and triggers of 8 bytes can be read"};
  if (version < 1 || version > 2)
    return Error{path, text("DAT version ", version, " is unknown"), "only 1 and 2 can be read"};
  bytes.skip(2);
  header.version_1 = version == 1;
  if (width > 0 && height > 0 && width <= 65536 && height <= 32768)
    header.size = {static_cast<int>(width), static_cast<int>(height)};
  return header;
}

class DatSource : public EventSource {
 public:
  static Expected<std::unique_ptr<DatSource>> open(const std::string& path) {
    auto bytes = ByteStream::open(path);
    if (!bytes) return bytes.error();
    const auto header = read_header(*bytes);
    if (!header) return header.error();
    return std::unique_ptr<DatSource>(new DatSource(*std::move(bytes), *header));
  }

  const Header& header() const { return header_; }

  Expected<bool> fetch(EventBlock& block) override {
    block.start();
    const auto bytes = bytes_.peek(kPiece);
    const std::size_t count = std::min(bytes.size(), kPiece) / kRecord;
    if (count == 0) return false;
    block.base_us = std::max(last_us_, wraps_us_);
    std::size_t i = 0;
    for (; i < count; ++i) {
      const auto record = load<std::uint64_t>(bytes, i * kRecord);
      const std::int64_t stamp = unwrapped(static_cast<std::uint32_t>(record));
      if (stamp - block.base_us > UINT32_MAX) {
        if (block.count > 0) break;
        block.base_us = stamp;
      }
      const auto fields = static_cast<std::uint32_t>(record >> 32);
      const auto dt = static_cast<std::uint32_t>(stamp - block.base_us);
      block.events[block.count++] = event_of_bits(
          header_.version_1 ? event_bits(dt, fields & 0x1FF, fields >> 9 & 0xFF, fields >> 17 & 1)
                            : event_bits(dt, fields & 0x3FFF, fields >> 14 & 0x3FFF, fields >> 28 & 1));
      last_us_ = stamp;
    }
    bytes_.skip(i * kRecord);
    return true;
  }

  /// The next triggers; false at the end.
  bool fetch(std::vector<Trigger>& triggers) {
    triggers.clear();
    const auto bytes = bytes_.peek(kPiece);
    const std::size_t count = std::min(bytes.size(), kPiece) / kRecord;
    for (std::size_t i = 0; i < count; ++i) {
      const auto fields = load<std::uint32_t>(bytes, i * kRecord + 4);
      last_us_ = unwrapped(load<std::uint32_t>(bytes, i * kRecord));
      triggers.push_back({last_us_ * kNsPerUs, (fields & 1) != 0, static_cast<int>(fields >> 26)});
    }
    bytes_.skip(count * kRecord);
    return count > 0;
  }

  void finish() const override {
    report(bytes_.path(), faults_);
    if (bytes_.left() > 0)
      log_warning(
          text(bytes_.path(), ": ends within an event; the last ", bytes_.left(), " bytes are left out"));
  }

 private:
  DatSource(ByteStream bytes, const Header& header) : bytes_(std::move(bytes)), header_(header) {}

  std::int64_t unwrapped(std::uint32_t t) {
    std::int64_t stamp = wraps_us_ + t;
    if (stamp >= last_us_) return stamp;
    if (last_us_ - stamp > kWrapUs / 2) {
      wraps_us_ += kWrapUs;
      return stamp + kWrapUs;
    }
    faults_.discontinuities += last_us_ - stamp > kHiccupUs ? 1 : 0;
    ++faults_.time_regressions;
    return last_us_;
  }

  ByteStream bytes_;
  Header header_;
  std::int64_t wraps_us_ = 0, last_us_ = 0;
  DecodeFaults faults_;
};

}  // namespace

bool starts_as_dat(std::string_view head) {
  std::size_t at = 0;
  while (head.substr(at).starts_with('%')) {
    const auto end = head.find('\n', at);
    if (end == std::string_view::npos) return false;
    at = end + 1;
  }
  return at > 0 && head.size() >= at + 2 && is_type(static_cast<unsigned char>(head[at])) &&
         head[at + 1] == static_cast<char>(kRecord);
}

Expected<std::unique_ptr<EventReader>> open_events_dat(const std::string& path,
                                                       const EventReadOptions& options) {
  const auto probe = DatSource::open(path);
  if (!probe) return probe.error();
  const Header header = (*probe)->header();
  if (header.type == kExternalTrigger)
    return Error{path, "holds triggers, no events", "name the file of the events"};
  return make_event_reader(path, options, header.size, [path]() -> Expected<std::unique_ptr<EventSource>> {
    auto source = DatSource::open(path);
    if (!source) return source.error();
    return std::unique_ptr<EventSource>(*std::move(source));
  });
}

Expected<std::vector<StreamInfo>> list_dat_streams(const std::string& path) {
  auto bytes = ByteStream::open(path);
  if (!bytes) return bytes.error();
  const auto header = read_header(*bytes);
  if (!header) return header.error();
  const bool triggers = header->type == kExternalTrigger;
  return std::vector<StreamInfo>{{triggers ? StreamKind::triggers : StreamKind::events,
                                  triggers ? "triggers" : "events", header->version_1 ? "DAT 1" : "DAT 2",
                                  bytes->left() / static_cast<std::int64_t>(kRecord)}};
}

Status read_dat_sensors(const std::string& path, const SensorSink& sink) {
  if (!sink.trigger) return {};
  auto source = DatSource::open(path);
  if (!source) return source.error();
  if ((*source)->header().type != kExternalTrigger) return {};
  std::vector<Trigger> triggers;
  while ((*source)->fetch(triggers))
    for (const Trigger& trigger : triggers) sink.trigger(trigger);
  return {};
}

}  // namespace evpose
