// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event.h"

namespace evpose {

/// Events in a block are at most this many, so that it stays in the cache between decoder and packer.
/// Fuzzers, whose inputs are small, meet the borders of blocks by smaller ones.
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
inline constexpr std::size_t kBlockEvents = 256;
#else
inline constexpr std::size_t kBlockEvents = 16384;
#endif

/// Events as a decoder gives them: the first `count` of `events`, each with the stamp
/// base_us + dt_us in whole microseconds.
struct EventBlock {
  std::int64_t base_us = 0;
  std::vector<Event> events;  ///< room; it is kept from block to block
  std::size_t count = 0;
  std::int64_t first_row = 0;  ///< number of the first event in the file, from 0
  /// The decoder stands for order and for pixels inside this size; 0x0, as after start(): nothing is checked.
  ImageSize sound_within;

  /// An empty block with room for kBlockEvents, whose first event is the one after the last block's.
  void start() {
    first_row += static_cast<std::int64_t>(count);
    count = 0;
    sound_within = {};
    if (events.size() < kBlockEvents) events.resize(kBlockEvents);
  }
  std::int64_t time_us(std::size_t i) const { return base_us + events[i].dt_us; }
};

static_assert(std::endian::native == std::endian::little, "files and memory have the same byte order");

/// An event as one number: what decoders write and checks read at full speed.
constexpr std::uint64_t event_bits(std::uint32_t dt_us, std::uint64_t x, std::uint64_t y, std::uint64_t on) {
  return dt_us | x << 32 | y << 48 | on << 63;
}
inline Event event_of_bits(std::uint64_t bits) { return std::bit_cast<Event>(bits); }

}  // namespace evpose
