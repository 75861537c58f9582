// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_bin40.h"

#include <algorithm>

#include "evpose/io/events/event_source.h"
#include "evpose/io/files/byte_stream.h"

namespace evpose {
namespace {

constexpr std::size_t kRecord = 5;
constexpr std::size_t kPiece = kRecord * 8192;
constexpr unsigned kTimePasses = 240;
constexpr std::int64_t kPassedUs = 1 << 13;

Expected<ByteStream> open_records(const std::string& path) {
  auto bytes = ByteStream::open(path);
  if (bytes && bytes->size() % static_cast<std::int64_t>(kRecord) != 0)
    return Error{path, text("has ", bytes->size(), " bytes, no multiple of the ", kRecord, " of an event"),
                 "is it a file of 40-bit events, and complete?"};
  return bytes;
}

class Bin40Source : public EventSource {
 public:
  static Expected<std::unique_ptr<EventSource>> open(const std::string& path) {
    auto bytes = open_records(path);
    if (!bytes) return bytes.error();
    return std::unique_ptr<EventSource>(new Bin40Source(*std::move(bytes)));
  }

  Expected<bool> fetch(EventBlock& block) override {
    block.start();
    const auto bytes = bytes_.peek(kPiece);
    const std::size_t end = std::min(bytes.size(), kPiece);
    if (end < kRecord) return false;
    std::size_t at = 0;
    for (; at + kRecord <= end; at += kRecord) {
      const auto byte = [&](std::size_t i) { return std::to_integer<std::uint32_t>(bytes[at + i]); };
      if (byte(1) == kTimePasses) {
        passed_us_ += kPassedUs;
        continue;
      }
      const std::int64_t t_us = passed_us_ + ((byte(2) & 0x7F) << 16 | byte(3) << 8 | byte(4));
      if (block.count == 0) block.base_us = t_us;
      const std::int64_t dt = t_us - block.base_us;
      if (dt < 0 || dt > UINT32_MAX) break;  // the packer judges the first of a block by its own time
      block.events[block.count++] =
          event_of_bits(event_bits(static_cast<std::uint32_t>(dt), byte(0), byte(1), byte(2) >> 7));
    }
    bytes_.skip(at);
    return true;
  }

 private:
  explicit Bin40Source(ByteStream bytes) : bytes_(std::move(bytes)) {}

  ByteStream bytes_;
  std::int64_t passed_us_ = 0;
};

}  // namespace

Expected<std::unique_ptr<EventReader>> open_events_bin40(const std::string& path,
                                                         const EventReadOptions& options) {
  return make_event_reader(path, options, {}, [path] { return Bin40Source::open(path); });
}

Expected<std::vector<StreamInfo>> list_bin40_streams(const std::string& path) {
  const auto bytes = open_records(path);
  if (!bytes) return bytes.error();
  return std::vector<StreamInfo>{
      {StreamKind::events, "events", "40-bit events", bytes->size() / static_cast<std::int64_t>(kRecord)}};
}

}  // namespace evpose
