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

/// EVT3, 16-bit words. State is kept from call to call, so that a stream may be fed in pieces of any length.
/// Stamps never go back: what the camera stamps earlier than the event before gets that one's stamp, and is
/// counted. Nothing is given before the stream has told its time.
class Evt3Decoder {
 public:
  /// Events outside of `size` are dropped; 0x0: none are.
  explicit Evt3Decoder(ImageSize size = {});

  /// Decodes until the bytes end or the block is full, appending to the block and, if there is one, to the
  /// list of triggers. Returns the number of bytes used; the others are to be given again, before what
  /// follows them: a single byte at the end, or more when the block must be emptied first (by start()).
  std::size_t decode(std::span<const std::byte> bytes, EventBlock& block,
                     std::vector<Trigger>* triggers = nullptr);

  /// Sensor time, microseconds with wraps counted; meaningful once started().
  std::int64_t now_us() const { return now_us_; }
  bool started() const { return started_; }
  const DecodeFaults& faults() const { return faults_; }

 private:
  std::size_t begin(const std::byte* bytes, std::size_t words);
  std::size_t plain(const std::byte* bytes, std::size_t words, EventBlock& block);
  std::size_t held(const std::byte* bytes, std::size_t words, EventBlock& block);
  void set_y(unsigned word);
  void set_base(unsigned word);
  void set_high(unsigned high);
  void vector(unsigned mask, unsigned length, EventBlock& block);
  bool has_room(const EventBlock& block) const;

  std::uint32_t width_, height_;
  std::int64_t loop_us_ = 0;  ///< wraps of the 24-bit clock
  std::int64_t high_us_ = 0;  ///< with wraps
  std::int64_t now_us_ = 0, last_us_ = INT64_MIN;
  unsigned high_ = 0;  ///< as last sent
  unsigned y_ = 0, base_x_ = 0, base_on_ = 0;
  bool has_high_ = false, started_ = false;
  DecodeFaults faults_;
};

}  // namespace evpose
