// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/io/events/decode_faults.h"
#include "evpose/io/events/event_block.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// The 34-bit clock of EVT2 and EVT2.1, whose upper 28 bits come in words of their own.
class Evt2Clock {
 public:
  bool started() const { return started_; }
  std::int64_t high_us() const { return high_us_; }  ///< wraps counted
  std::int64_t wraps_us() const { return wraps_us_; }
  /// Takes the 28 bits of a time word.
  void set(std::uint32_t high, DecodeFaults& faults);
  /// Of a word that is known to go on from the last.
  void advance(std::int64_t high_us) { high_us_ = high_us; }

 private:
  bool started_ = false;
  std::int64_t high_us_ = 0, wraps_us_ = 0;
};

/// EVT2, 32-bit words. Used as Evt3Decoder is; events before the first time word are dropped.
class Evt2Decoder {
 public:
  explicit Evt2Decoder(ImageSize size = {});
  std::size_t decode(std::span<const std::byte> bytes, EventBlock& block,
                     std::vector<Trigger>* triggers = nullptr);
  const DecodeFaults& faults() const { return faults_; }

 private:
  std::size_t groups(const std::byte* bytes, std::size_t words, EventBlock& block);
  std::size_t plain(const std::byte* bytes, std::size_t words, EventBlock& block);

  std::uint64_t width_, height_;
  Evt2Clock clock_;
  std::int64_t last_us_ = INT64_MIN;
  DecodeFaults faults_;
};

/// EVT2.1, 64-bit words that hold up to 32 events.
class Evt21Decoder {
 public:
  /// `legacy`: the upper half of a word stands first in the file.
  explicit Evt21Decoder(ImageSize size = {}, bool legacy = true);
  std::size_t decode(std::span<const std::byte> bytes, EventBlock& block,
                     std::vector<Trigger>* triggers = nullptr);
  const DecodeFaults& faults() const { return faults_; }

  /// Words that carry the time, with either order: with the wrong one there are next to none.
  static std::size_t time_words(std::span<const std::byte> bytes, bool legacy);

 private:
  void events(std::uint64_t word, EventBlock& block);

  std::uint64_t width_, height_;
  bool legacy_;
  Evt2Clock clock_;
  std::int64_t last_us_ = INT64_MIN;
  DecodeFaults faults_;
};

}  // namespace evpose
