// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/event_messages.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

using Encoding = EventMessage::Encoding;

constexpr std::int64_t kLibcaerWrapUs = std::int64_t{1} << 31;

template <class T>
T load(const std::byte* from) {
  T out;
  std::memcpy(&out, from, sizeof out);
  return out;
}

/// False if the block cannot take the event.
bool push(EventBlock& block, std::int64_t t_us, unsigned x, unsigned y, bool on) {
  if (block.count >= block.events.size()) return false;
  if (block.count == 0) block.base_us = t_us;
  const std::int64_t dt = t_us - block.base_us;
  if (dt < 0 || dt > UINT32_MAX) return false;
  block.events[block.count++] = event_of_bits(event_bits(static_cast<std::uint32_t>(dt), x, y, on ? 1 : 0));
  return true;
}

std::int64_t floor_us(TimeNs t) { return t / kNsPerUs - (t % kNsPerUs < 0 ? 1 : 0); }

struct NamedEncoding {
  std::string_view name;
  Encoding encoding;
  std::size_t word;  ///< bytes of what is in one byte order
};
constexpr std::array<NamedEncoding, 5> kEncodings = {{{"evt3", Encoding::evt3, 2},
                                                      {"mono", Encoding::mono, 8},
                                                      {"trigger", Encoding::trigger, 8},
                                                      {"libcaer", Encoding::libcaer, 4},
                                                      {"libcaer_cmp", Encoding::libcaer_cmp, 2}}};

std::size_t word_of(Encoding encoding) {
  for (const NamedEncoding& known : kEncodings)
    if (known.encoding == encoding) return known.word;
  return 1;
}

Error not_such(const std::string& where, const BagTopic& topic) {
  return Error{where, "is no whole message of type " + topic.type, "is the bag damaged?"};
}

ImageSize read_size(MessageReader& reader) {
  const std::uint32_t height = reader.u32(), width = reader.u32();
  if (height == 0 || width == 0 || height > 32768 || width > 65536) return {};  // not known
  return {static_cast<int>(width), static_cast<int>(height)};
}

Expected<EventMessage> parse_packet(MessageReader& reader, EventMessage out, const BagTopic& topic,
                                    const std::string& where) {
  reader.u64();  // seq
  const std::uint64_t base = reader.u64();
  const std::string_view name = reader.string();
  out.big_endian = reader.u8() != 0;
  out.data = reader.byte_sequence();
  if (!reader.ok()) return not_such(where, topic);
  const auto* const known = std::find_if(kEncodings.begin(), kEncodings.end(),
                                         [&](const NamedEncoding& e) { return e.name == name; });
  if (known == kEncodings.end())
    return Error{where, text("events encoded as '", name.substr(0, 20), "' cannot be read"),
                 "known are evt3, mono, trigger, libcaer and libcaer_cmp"};
  out.encoding = known->encoding;
  if (out.encoding == Encoding::evt3) return out;  // has no base
  if (base > static_cast<std::uint64_t>(kLargestTimeNs))
    return Error{where, text("the time base ", base, " ns is out of range"), "is the bag damaged?"};
  out.time_base = static_cast<TimeNs>(base);
  return out;
}

}  // namespace

bool is_event_array(std::string_view type) {
  return type == "dvs_msgs/EventArray" || type == "prophesee_event_msgs/EventArray";
}

bool is_event_packet(std::string_view type) {
  return type == "event_camera_msgs/EventPacket" || type == "event_array_msgs/EventArray";
}

Expected<EventMessage> parse_event_message(const BagTopic& topic, const BagMessage& message,
                                           const std::string& where) {
  MessageReader reader(message.data, topic.wire);
  EventMessage out;
  if (!reader.is_cdr()) reader.u32();  // seq
  out.stamp = reader.time();
  reader.string();  // frame_id
  out.size = read_size(reader);
  if (is_event_packet(topic.type)) return parse_packet(reader, out, topic, where);
  constexpr std::size_t kSmallestEvent = 13;
  out.count = reader.u32();
  if (!reader.ok() || out.count > reader.left() / kSmallestEvent) return not_such(where, topic);
  out.aligned = reader.is_cdr();
  out.big_endian = reader.swapped();
  out.begin = reader.position();
  out.data = reader.whole();
  return out;
}

void EventMessageDecoder::begin(const EventMessage& message, std::string where) {
  message_ = message;
  where_ = std::move(where);
  position_ = message.begin;
  index_ = 0;
  wraps_us_ = 0, last_t_ = INT32_MIN;
  high_ = low_ = mask_ = 0;
  x_ = row_ = next_row_ = on_ = 0;
  data_ = message.data;
  if (message.encoding == Encoding::evt3 && !has_evt3_) {
    evt3_ = Evt3Decoder(message.size);
    has_evt3_ = true;
  }
  const std::size_t word = word_of(message.encoding);
  data_ = data_.first(data_.size() / word * word);  // a part of a word at the end is no event
  if (!message.big_endian || message.encoding == Encoding::array) return;
  swapped_.assign(data_.begin(), data_.end());
  for (auto at = swapped_.begin(); at != swapped_.end(); at += static_cast<std::ptrdiff_t>(word))
    std::reverse(at, at + static_cast<std::ptrdiff_t>(word));
  data_ = swapped_;
}

Expected<bool> EventMessageDecoder::decode(EventBlock& block, std::vector<Trigger>* triggers) {
  switch (message_.encoding) {
    case Encoding::array:
      return decode_array(block);
    case Encoding::evt3:
      position_ += evt3_.decode(data_.subspan(position_), block, triggers);
      return position_ == data_.size();
    case Encoding::mono:
      return decode_mono(block);
    case Encoding::trigger:
      decode_triggers(triggers);
      return true;
    case Encoding::libcaer:
      return decode_libcaer(block);
    case Encoding::libcaer_cmp:
      return decode_libcaer_cmp(block);
  }
  return true;
}

/// x, y u16, time 2 x 32 bits, polarity u8; packed, or in CDR with the time aligned to four.
Expected<bool> EventMessageDecoder::decode_array(EventBlock& block) {
  for (; index_ < message_.count; ++index_) {
    const std::size_t xy = message_.aligned ? (position_ + 1) & ~std::size_t{1} : position_;
    const std::size_t time = message_.aligned ? (xy + 4 + 3) & ~std::size_t{3} : xy + 4;
    if (time + 9 > data_.size())
      return Error{where_, text("the message ends inside its event ", index_), "is the bag damaged?"};
    const std::byte* at = data_.data();
    auto x = load<std::uint16_t>(at + xy), y = load<std::uint16_t>(at + xy + 2);
    auto seconds = load<std::uint32_t>(at + time), nanoseconds = load<std::uint32_t>(at + time + 4);
    if (message_.big_endian) {
      x = __builtin_bswap16(x), y = __builtin_bswap16(y);
      seconds = __builtin_bswap32(seconds), nanoseconds = __builtin_bswap32(nanoseconds);
    }
    if (y >= 32768)
      return Error{where_, text("event ", index_, " of the message is in row ", y, ", beyond any sensor"),
                   "is the bag damaged?"};
    const std::int64_t whole =
        message_.aligned ? static_cast<std::int32_t>(seconds) : static_cast<std::int64_t>(seconds);
    const bool on = at[time + 8] != std::byte{0};
    if (!push(block, whole * 1'000'000 + nanoseconds / 1000, x, y, on)) return false;
    position_ = time + 9;
  }
  return true;
}

bool EventMessageDecoder::decode_mono(EventBlock& block) {
  for (; position_ < data_.size(); position_ += 8) {
    const auto word = load<std::uint64_t>(data_.data() + position_);
    const TimeNs t = message_.time_base + static_cast<TimeNs>(word & 0xFFFFFFFF);
    if (!push(block, floor_us(t), word >> 32 & 0xFFFF, word >> 48 & 0x7FFF, word >> 63 != 0)) return false;
  }
  return true;
}

void EventMessageDecoder::decode_triggers(std::vector<Trigger>* triggers) {
  for (; position_ < data_.size(); position_ += 8) {
    const auto word = load<std::uint64_t>(data_.data() + position_);
    if (triggers == nullptr) continue;
    triggers->push_back({message_.time_base + static_cast<TimeNs>(word & 0xFFFFFFFF), word >> 63 != 0,
                         static_cast<int>(word >> 48 & 0x7FFF)});
  }
}

bool EventMessageDecoder::decode_libcaer(EventBlock& block) {
  const std::int64_t base_us = floor_us(message_.time_base);
  for (; position_ + 8 <= data_.size(); position_ += 8) {
    const auto word = load<std::uint32_t>(data_.data() + position_);
    const auto t = load<std::int32_t>(data_.data() + position_ + 4);
    if ((word & 1) == 0) continue;  // marked as not valid
    if (t < last_t_) wraps_us_ += kLibcaerWrapUs;
    last_t_ = t;
    if (push(block, base_us + wraps_us_ + t, word >> 17, word >> 2 & 0x7FFF, (word >> 1 & 1) != 0)) continue;
    return false;
  }
  return true;
}

/// The rest of the piece of a column in mask_, from row_ on.
bool EventMessageDecoder::emit_vector(EventBlock& block) {
  const std::int64_t t = floor_us(message_.time_base) + (high_ << 12 | low_);
  for (; mask_ != 0; mask_ &= mask_ - 1) {
    const unsigned y = row_ + static_cast<unsigned>(std::countr_zero(mask_));
    if (!push(block, t, x_, y, on_ != 0)) return false;
  }
  return true;
}

/// Words as those of EVT3, with rows in the place of columns.
bool EventMessageDecoder::decode_libcaer_cmp(EventBlock& block) {
  constexpr unsigned kTimeHigh = 0, kTimeLow = 1, kAddressX = 2, kAddressY = 3, kBaseY = 4, kVector8 = 5;
  while (emit_vector(block)) {
    if (position_ == data_.size()) return true;
    const unsigned word = load<std::uint16_t>(data_.data() + position_);
    const unsigned code = word >> 12;
    if (code == kTimeHigh) high_ = word & 0xFFF;
    if (code == kTimeLow) low_ = word & 0xFFF;
    if (code == kAddressX) x_ = word & 0x7FF;
    if (code == kAddressY || code == kBaseY) row_ = word & 0x7FF, on_ = word >> 11 & 1;
    if (code == kAddressY) mask_ = 1;
    if (code == kBaseY) next_row_ = row_;
    if (code == kVector8) mask_ = word & 0xFF, row_ = next_row_, next_row_ += 8;
    position_ += 2;
  }
  return false;
}

}  // namespace evpose
