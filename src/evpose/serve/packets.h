// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/io/events/evt3.h"
#include "evpose/serve/stream_queue.h"

namespace evpose {

/// The packets of a camera's driver (docs/use/live.md): a header of 24 bytes and a payload. In a datagram
/// stands one packet, in a stream one follows the other.
struct PacketHeader {
  static constexpr std::size_t kBytes = 24;
  static constexpr std::uint32_t kMagic = 0x31505645;     ///< "EVP1"
  static constexpr std::uint32_t kMostPayload = 1 << 22;  ///< bytes
  enum class Kind : std::uint8_t { events = 1, imu = 2, evt3 = 3 };

  Kind kind = Kind::events;
  std::uint32_t sequence = 0;  ///< +1 for each packet of a sender
  std::uint32_t payload = 0;   ///< bytes
  TimeNs base = 0;             ///< of events: time of dt_us == 0; of evt3: added to the sensor's time
};

std::vector<std::uint8_t> encode_packet(const EventPacket& events, std::uint32_t sequence);
std::vector<std::uint8_t> encode_packet(std::span<const ImuSample> imu, std::uint32_t sequence);
std::vector<std::uint8_t> encode_evt3_packet(std::span<const std::uint8_t> words, TimeNs base,
                                             std::uint32_t sequence);

/// Packets of one sender into items. Nothing that arrives makes it fail: what is no packet is counted and
/// skipped, a stream goes on at the next header.
class PacketDecoder {
 public:
  explicit PacketDecoder(ImageSize size) : size_(size), evt3_(size) {}

  /// One datagram.
  void datagram(std::span<const std::uint8_t> bytes, std::vector<StreamItem>& out);
  /// Any piece of a stream.
  void stream(std::span<const std::uint8_t> bytes, std::vector<StreamItem>& out);

  struct Counts {
    std::uint64_t packets = 0, missed = 0;  ///< by sequence number
    std::uint64_t bad_packets = 0, skipped_bytes = 0;
    std::uint64_t bad_events = 0, bad_samples = 0;  ///< out of order or outside of the image; not finite
  };
  const Counts& counts() const { return counts_; }

 private:
  std::optional<PacketHeader> header(std::span<const std::uint8_t> bytes) const;
  void payload(const PacketHeader& header, std::span<const std::uint8_t> bytes, std::vector<StreamItem>& out);
  void take_events(const PacketHeader& header, std::span<const std::uint8_t> bytes,
                   std::vector<StreamItem>& out);
  void take_imu(std::span<const std::uint8_t> bytes, std::vector<StreamItem>& out);
  void take_evt3(const PacketHeader& header, std::span<const std::uint8_t> bytes,
                 std::vector<StreamItem>& out);

  ImageSize size_;
  Evt3Decoder evt3_;
  std::vector<std::uint8_t> buffer_;  ///< of a stream: less than a packet
  std::vector<std::byte> words_;      ///< of evt3: what the decoder has not taken yet
  EventBlock block_;                  ///< likewise: room for events
  std::optional<std::uint32_t> sequence_;
  Counts counts_;
};

}  // namespace evpose
