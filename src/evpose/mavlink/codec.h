// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "evpose/mavlink/messages.h"

namespace evpose::mavlink {

static_assert(std::endian::native == std::endian::little, "the wire's byte order is the machine's");

using Bytes = std::span<const std::uint8_t>;

/// CRC-16/MCRF4XX over `bytes`, going on from `crc`.
std::uint16_t crc(Bytes bytes, std::uint16_t crc = 0xFFFF);

/// What is known of a message; null: nothing, so that its checksum cannot be judged.
const MessageType* find_type(std::uint32_t id);

/// A frame whose checksum holds. Signatures are not verified.
struct Frame {
  int version = 2;
  bool is_signed = false;
  std::uint8_t sequence = 0, system = 0, component = 0;
  std::uint32_t id = 0;
  std::size_t length = 0;                   ///< as sent
  std::array<std::uint8_t, 255> payload{};  ///< zero beyond its length
};

/// A whole frame on the wire.
struct FrameBytes {
  std::array<std::uint8_t, 280> data{};
  std::size_t size = 0;
  Bytes bytes() const { return {data.data(), size}; }
};

/// Payload with its zeros at the end dropped, header and checksum.
FrameBytes encode_frame(std::uint32_t id, Bytes payload, std::uint8_t sequence, std::uint8_t system,
                        std::uint8_t component);

/// A message as a MAVLink 2 frame.
template <class Message>
FrameBytes encode(const Message& message, std::uint8_t sequence, std::uint8_t system,
                  std::uint8_t component) {
  std::array<std::uint8_t, 255> payload{};
  std::size_t at = 0;
  Message::fields(message, [&](const auto&... field) {
    ((std::memcpy(payload.data() + at, &field, sizeof field), at += sizeof field), ...);
  });
  return encode_frame(Message::kType.id, {payload.data(), at}, sequence, system, component);
}

/// The message of a frame; nothing if it is another one, or shorter than version 1 allows. Missing bytes are
/// zero, extra ones are ignored.
template <class Message>
std::optional<Message> decode(const Frame& frame) {
  if (frame.id != Message::kType.id) return std::nullopt;
  if (frame.version == 1 && frame.length < Message::kType.least) return std::nullopt;
  Message message;
  std::size_t at = 0;
  Message::fields(message, [&](auto&... field) {
    ((std::memcpy(&field, frame.payload.data() + at, sizeof field), at += sizeof field), ...);
  });
  return message;
}

/// Frames out of a stream of bytes, cut anywhere. After anything that is no sound frame it goes on one byte
/// after the false start, so that garbage never hides a frame; it holds less than one frame of bytes.
class Parser {
 public:
  struct Counts {
    std::uint64_t bytes = 0, frames = 0, bad_checksum = 0, unknown = 0, skipped_bytes = 0;
  };

  /// Calls `sink(const Frame&)` for each frame.
  void parse(Bytes bytes, auto&& sink) {
    counts_.bytes += bytes.size();
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    std::size_t at = 0;
    Frame frame;
    while (true) {
      const Step step = next(Bytes(buffer_).subspan(at), frame);
      at += step.used;
      if (step.complete) sink(static_cast<const Frame&>(frame));
      if (step.used == 0) break;
    }
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at));
  }
  const Counts& counts() const { return counts_; }

 private:
  struct Step {
    std::size_t used = 0;  ///< 0: more bytes are needed
    bool complete = false;
  };
  Step next(Bytes bytes, Frame& frame);

  std::vector<std::uint8_t> buffer_;
  Counts counts_;
};

}  // namespace evpose::mavlink
