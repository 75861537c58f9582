// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "evpose/io/events/event_block.h"
#include "evpose/io/events/event_reader.h"

namespace evpose {

/// Events as a file with wide columns holds them, stamps already in whole microseconds, nothing checked.
struct RawEvents {
  std::vector<std::int64_t> t_us;
  std::vector<std::int32_t> x, y, p;
  std::int64_t first_row = 0;      ///< number of the first event in the file, from 0
  std::vector<std::int64_t> line;  ///< line of each event, from 1; empty where files have no lines

  std::size_t size() const { return t_us.size(); }
};

/// Whole microseconds farther than this from zero have no time in nanoseconds.
inline constexpr std::int64_t kLargestTimeUs = 3'000'000'000'000'000;

/// Checks events and cuts them into packets: what all event formats share.
class EventPacker {
 public:
  /// Fills the block with the next events; false at the end. A block of none is allowed before the end.
  using Fetch = std::function<Expected<bool>(RawEvents&)>;
  /// The same for decoders that write Event themselves: the fast way.
  using FetchBlock = std::function<Expected<bool>(EventBlock&)>;

  /// Errors: a flip without a size, packet_s out of range.
  static Expected<EventPacker> make(std::string path, const EventReadOptions& options, ImageSize size,
                                    Fetch fetch);
  static Expected<EventPacker> make(std::string path, const EventReadOptions& options, ImageSize size,
                                    FetchBlock fetch);

  Expected<bool> next(EventPacket& packet);
  ImageSize size() const { return size_; }
  /// Stamps below this, in the file's own microseconds, are cropped: where a reader may begin.
  std::int64_t first_us() const { return first_us_; }

 private:
  EventPacker() = default;
  static Expected<EventPacker> make(std::string path, const EventReadOptions& options, ImageSize size);

  Expected<bool> fetch();                    ///< the next block, checked; false at the end
  void narrow();                             ///< raw events to the block, up to the first that does not fit
  std::size_t sound() const;                 ///< how many events of the block are plausible
  bool plausible(std::size_t i);             ///< of raw events
  Expected<bool> take(EventPacket& packet);  ///< of the block, until the packet is full; true when it is
  std::size_t end_of_packet(const EventPacket& packet) const;
  void append(EventPacket& packet, std::size_t end);
  std::size_t first_at(std::int64_t t_us) const;  ///< first sound event from position_ on, not before t_us

  /// The first event that is not plausible, as the file has it.
  struct Suspect {
    std::int64_t t_us = 0;
    std::int32_t x = 0, y = 0, p = 0;
  };
  Suspect suspect() const;
  Error fault() const;  ///< what is not plausible
  Error error(std::size_t i, const std::string& what, const std::string& fix) const;

  std::string path_;
  EventReadOptions options_;
  ImageSize size_;
  Fetch fetch_raw_;
  FetchBlock fetch_block_;
  RawEvents raw_;
  std::size_t raw_begin_ = 0, raw_end_ = 0;  ///< the part of raw_ that is in the block
  bool raw_fault_ = false;                   ///< the event at raw_end_ is not plausible
  EventBlock block_;
  std::size_t position_ = 0, sound_ = 0;
  std::int64_t packet_us_ = 1000;
  std::int64_t first_us_ = std::numeric_limits<std::int64_t>::min();
  std::int64_t stop_us_ = std::numeric_limits<std::int64_t>::max();
  std::int64_t last_us_ = std::numeric_limits<std::int64_t>::min();
  std::int64_t base_us_ = 0, window_end_us_ = 0;  ///< of the packet being filled
  int widest_ = 65536, highest_ = 32768;          ///< what Event can hold, or the size
  unsigned polarities_ = 0;                       ///< bit p + 1: seen
  bool done_ = false;
};

}  // namespace evpose
