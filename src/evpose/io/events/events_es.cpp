// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_es.h"

#include <algorithm>

#include "evpose/core/log.h"
#include "evpose/io/events/event_packer.h"
#include "evpose/io/events/event_source.h"
#include "evpose/io/files/byte_stream.h"

namespace evpose {
namespace {

constexpr std::string_view kMagic = "Event Stream";
constexpr std::size_t kPiece = 64 << 10;
constexpr std::size_t kEventBytes = 5, kColourBytes = 8;

enum Type : unsigned { kGeneric = 0, kDvs = 1, kAtis = 2, kDisplay = 3, kColour = 4 };

struct Header {
  unsigned type = kDvs;
  ImageSize size;
};

const char* name_of(unsigned type) {
  switch (type) {
    case kGeneric:
      return "generic";
    case kDvs:
      return "DVS";
    case kAtis:
      return "ATIS";
    case kDisplay:
      return "display";
    case kColour:
      return "colour";
    default:
      return "unknown";
  }
}

/// Leaves the stream at the first event.
Expected<Header> read_header(ByteStream& bytes) {
  const std::string& path = bytes.path();
  const auto head = bytes.peek(20);
  if (!as_text(head).starts_with(kMagic))
    return Error{path, "does not begin as an Event Stream file", "name another events.format"};
  if (head.size() < 16) return Error{path, "ends within its header", "copy the file again"};
  if (head[12] != std::byte{2})
    return Error{path, text("Event Stream version ", std::to_integer<int>(head[12]), " cannot be read"),
                 "convert it to version 2"};
  Header header{.type = std::to_integer<unsigned>(head[15]), .size = {}};
  if (header.type > kColour || header.type == kDisplay)
    return Error{path, text("streams of type ", header.type, " cannot be read"),
                 "record a DVS or ATIS stream"};
  if (header.type == kGeneric) {
    bytes.skip(16);
    return header;
  }
  if (head.size() < 20) return Error{path, "ends within its header", "copy the file again"};
  header.size = {load<std::uint16_t>(head, 16), load<std::uint16_t>(head, 18)};
  if (header.size.width == 0 || header.size.height == 0 || header.size.height > 32768)
    return Error{path, text("an image of ", header.size.width, " x ", header.size.height, " pixels"),
                 "the file is damaged; copy it again"};
  bytes.skip(20);
  return header;
}

/// What the first byte of an event says.
struct Start {
  bool is_event = true;  ///< false: only time passes
  std::int64_t passed_us = 0;
  bool on = false, exposure = false;
};

Start start_of(unsigned type, unsigned byte) {
  if (type == kDvs) {
    if (byte >= 0xFE) return {.is_event = false, .passed_us = byte == 0xFF ? 0x7F : 0};
    return {.passed_us = byte >> 1, .on = (byte & 1) != 0};
  }
  if (type == kAtis) {
    if (byte >= 0xFC) return {.is_event = false, .passed_us = 0x3F * (byte & 3)};
    return {.passed_us = byte >> 2, .on = (byte & 2) != 0, .exposure = (byte & 1) != 0};
  }
  if (byte >= 0xFE) return {.is_event = false, .passed_us = byte == 0xFF ? 0xFE : 0};
  return {.passed_us = byte};
}

class EsSource : public EventSource {
 public:
  static Expected<std::unique_ptr<EventSource>> open(const std::string& path) {
    auto bytes = ByteStream::open(path);
    if (!bytes) return bytes.error();
    const auto header = read_header(*bytes);
    if (!header) return header.error();
    return std::unique_ptr<EventSource>(new EsSource(*std::move(bytes), *header));
  }

  Expected<bool> fetch(EventBlock& block) override {
    block.start();
    const auto bytes = bytes_.peek(kPiece);
    const std::size_t end = std::min(bytes.size(), kPiece);
    const auto last_row = static_cast<std::uint64_t>(header_.size.height - 1);
    std::size_t at = 0;
    while (at < end && block.count < block.events.size()) {
      const Start start = start_of(header_.type, std::to_integer<unsigned>(bytes[at]));
      if (start.is_event && at + kEventBytes > end) break;
      const std::int64_t t_us = t_us_ + start.passed_us;
      if (block.count == 0) block.base_us = t_us;
      if (t_us - block.base_us > UINT32_MAX || t_us > kLargestTimeUs) break;
      t_us_ = t_us;
      if (!start.is_event) {
        ++at;
        continue;
      }
      const std::uint64_t x = load<std::uint16_t>(bytes, at + 1), row = load<std::uint16_t>(bytes, at + 3);
      // A row beyond the image must not come around to its other end.
      const std::uint64_t y = row <= last_row ? last_row - row : 0x7FFF;
      block.events[block.count] =
          event_of_bits(event_bits(static_cast<std::uint32_t>(t_us - block.base_us), x, y, start.on ? 1 : 0));
      block.count += start.exposure ? 0 : 1;
      at += kEventBytes;
    }
    bytes_.skip(at);
    return at > 0;
  }

  void finish() const override {
    if (bytes_.left() > 0) log_warning(text(bytes_.path(), ": ends within an event, which is left out"));
  }

 private:
  EsSource(ByteStream bytes, const Header& header) : bytes_(std::move(bytes)), header_(header) {}

  ByteStream bytes_;
  Header header_;
  std::int64_t t_us_ = 0;
};

/// Packets of a generic stream: a time, a length in groups of 7 bits, that many bytes. -1: cut off.
std::int64_t skip_generic(ByteStream& bytes) {
  std::uint64_t length = 0;
  for (unsigned shift = 0; shift < 63; shift += 7) {
    const auto next = bytes.peek(1);
    if (next.empty()) return -1;
    const auto byte = std::to_integer<std::uint64_t>(next[0]);
    bytes.skip(1);
    length |= byte >> 1 << shift;
    if ((byte & 1) != 0) continue;
    if (length > static_cast<std::uint64_t>(bytes.left())) return -1;
    bytes.skip(length);
    return 1;
  }
  return -1;
}

/// Whole events or packets up to the end of the file.
std::int64_t count_items(ByteStream& bytes, unsigned type) {
  std::int64_t count = 0;
  while (true) {
    const auto next = bytes.peek(1);
    if (next.empty()) return count;
    const Start start = start_of(type, std::to_integer<unsigned>(next[0]));
    bytes.skip(1);
    if (!start.is_event) continue;
    if (type == kGeneric) {
      if (skip_generic(bytes) < 0) return count;
    } else {
      const std::size_t rest = (type == kColour ? kColourBytes : kEventBytes) - 1;
      if (bytes.left() < static_cast<std::int64_t>(rest)) return count;
      bytes.skip(rest);
    }
    count += start.exposure ? 0 : 1;
  }
}

}  // namespace

bool starts_as_es(std::string_view head) { return head.starts_with(kMagic); }

Expected<std::unique_ptr<EventReader>> open_events_es(const std::string& path,
                                                      const EventReadOptions& options) {
  auto bytes = ByteStream::open(path);
  if (!bytes) return bytes.error();
  const auto header = read_header(*bytes);
  if (!header) return header.error();
  if (header->type != kDvs && header->type != kAtis)
    return Error{path, text("is a ", name_of(header->type), " stream: it holds no events"),
                 "name a DVS or ATIS stream"};
  return make_event_reader(path, options, header->size, [path] { return EsSource::open(path); });
}

Expected<std::vector<StreamInfo>> list_es_streams(const std::string& path) {
  auto bytes = ByteStream::open(path);
  if (!bytes) return bytes.error();
  const auto header = read_header(*bytes);
  if (!header) return header.error();
  const bool events = header->type == kDvs || header->type == kAtis;
  return std::vector<StreamInfo>{{events ? StreamKind::events : StreamKind::other, name_of(header->type),
                                  text("Event Stream ", name_of(header->type)),
                                  count_items(*bytes, header->type)}};
}

}  // namespace evpose
