// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/events/evt3.h"

namespace evpose {

/// A message of events: dvs_msgs/EventArray and its likes, or event_camera_msgs/EventPacket, once named
/// event_array_msgs/EventArray. Views hold as long as the message.
struct EventMessage {
  enum class Encoding : std::uint8_t { array, evt3, mono, trigger, libcaer, libcaer_cmp };

  Encoding encoding = Encoding::array;
  ImageSize size;
  TimeNs stamp = 0;      ///< of the header, on the recorder's clock
  TimeNs time_base = 0;  ///< of packets
  bool big_endian = false;
  std::span<const std::byte> data;  ///< of packets: the encoded events; of arrays: the whole message
  std::size_t begin = 0;            ///< of arrays: where in data the events begin
  std::size_t count = 0;            ///< of arrays
  bool aligned = false;             ///< of arrays: fields are aligned as in CDR
};

/// Whether messages of the type are events.
bool is_event_array(std::string_view type);
bool is_event_packet(std::string_view type);

/// Errors, at `where`: not such a message, an encoding that is not known, named.
Expected<EventMessage> parse_event_message(const BagTopic& topic, const BagMessage& message,
                                           const std::string& where);

/// Events and triggers out of messages of one topic. Stamps are whole microseconds: of evt3 the sensor's own,
/// of the others those of the recorder's clock. State runs on from message to message where the encoding
/// wants it.
class EventMessageDecoder {
 public:
  /// The next message; its views must hold until all of it is decoded.
  void begin(const EventMessage& message, std::string where);
  /// Appends until the message ends (true) or the block is full or cannot hold the next stamp (false; to go
  /// on with an empty block). Errors: an array cut off, a pixel that no event can hold.
  Expected<bool> decode(EventBlock& block, std::vector<Trigger>* triggers = nullptr);

 private:
  Expected<bool> decode_array(EventBlock& block);
  bool decode_mono(EventBlock& block);
  void decode_triggers(std::vector<Trigger>* triggers);
  bool decode_libcaer(EventBlock& block);
  bool decode_libcaer_cmp(EventBlock& block);
  bool emit_vector(EventBlock& block);

  EventMessage message_;
  std::string where_;
  std::span<const std::byte> data_;  ///< of the message, in the machine's byte order
  std::vector<std::byte> swapped_;
  std::size_t position_ = 0, index_ = 0;
  Evt3Decoder evt3_;
  bool has_evt3_ = false;
  std::int64_t wraps_us_ = 0;
  std::int32_t last_t_ = 0;
  unsigned high_ = 0, low_ = 0, x_ = 0, row_ = 0, next_row_ = 0, on_ = 0;
  unsigned mask_ = 0;  ///< rest of a vector that did not fit into a block
};

}  // namespace evpose
