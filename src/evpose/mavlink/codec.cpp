// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/mavlink/codec.h"

#include <algorithm>

namespace evpose::mavlink {
namespace {

constexpr std::uint8_t kStart2 = 0xFD, kStart1 = 0xFE;
constexpr std::size_t kHeader2 = 10, kHeader1 = 6, kChecksum = 2, kSignature = 13;
constexpr std::uint8_t kSigned = 1;  // the only incompatibility flag that is known

const std::vector<MessageType>& types() {
  static const std::vector<MessageType> all = [] {
    std::vector<MessageType> out;
    for_each_message([&](const auto& message) { out.push_back(message.kType); });
    return out;
  }();
  return all;
}

std::uint16_t checksum(Bytes header_and_payload, const MessageType& type) {
  return crc({&type.crc_extra, 1}, crc(header_and_payload));
}

}  // namespace

std::uint16_t crc(Bytes bytes, std::uint16_t crc) {
  for (const std::uint8_t byte : bytes) {
    auto t = static_cast<std::uint8_t>(byte ^ (crc & 0xFF));
    t = static_cast<std::uint8_t>(t ^ (t << 4));
    crc = static_cast<std::uint16_t>((crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4));
  }
  return crc;
}

const MessageType* find_type(std::uint32_t id) {
  for (const MessageType& type : types())
    if (type.id == id) return &type;
  return nullptr;
}

FrameBytes encode_frame(std::uint32_t id, Bytes payload, std::uint8_t sequence, std::uint8_t system,
                        std::uint8_t component) {
  while (payload.size() > 1 && payload.back() == 0) payload = payload.first(payload.size() - 1);
  FrameBytes out;
  const auto byte = [](std::size_t value) { return static_cast<std::uint8_t>(value & 0xFF); };
  const std::uint8_t header[kHeader2] = {
      kStart2,       byte(payload.size()), 0, 0, sequence, system, component, byte(id),
      byte(id >> 8), byte(id >> 16)};
  std::copy_n(header, kHeader2, out.data.begin());
  std::copy(payload.begin(), payload.end(), out.data.begin() + kHeader2);
  const std::size_t end = kHeader2 + payload.size();
  const MessageType* type = find_type(id);
  const std::uint16_t sum = checksum({out.data.data() + 1, end - 1}, type ? *type : MessageType{});
  out.data[end] = byte(sum);
  out.data[end + 1] = byte(sum >> 8);
  out.size = end + kChecksum;
  return out;
}

Parser::Step Parser::next(Bytes bytes, Frame& frame) {
  if (bytes.empty()) return {};
  const bool v2 = bytes[0] == kStart2;
  if (!v2 && bytes[0] != kStart1) {
    const auto start =
        std::find_if(bytes.begin(), bytes.end(), [](std::uint8_t b) { return b == kStart1 || b == kStart2; });
    const auto skipped = static_cast<std::size_t>(start - bytes.begin());
    counts_.skipped_bytes += skipped;
    return {skipped, false};
  }
  const std::size_t header = v2 ? kHeader2 : kHeader1;
  if (bytes.size() < header) return {};
  const auto refuse = [&](std::uint64_t& count) {
    ++count;
    ++counts_.skipped_bytes;
    return Step{1, false};
  };
  if (v2 && (bytes[2] & ~kSigned) != 0) return refuse(counts_.unknown);
  frame = {};
  frame.version = v2 ? 2 : 1;
  frame.length = bytes[1];
  frame.is_signed = v2 && (bytes[2] & kSigned) != 0;
  const Bytes ids = bytes.subspan(v2 ? 4 : 2);
  frame.sequence = ids[0], frame.system = ids[1], frame.component = ids[2];
  frame.id = v2 ? ids[3] | std::uint32_t{ids[4]} << 8 | std::uint32_t{ids[5]} << 16 : ids[3];
  const MessageType* type = find_type(frame.id);
  if (type == nullptr) return refuse(counts_.unknown);
  const std::size_t end = header + frame.length;
  const std::size_t size = end + kChecksum + (frame.is_signed ? kSignature : 0);
  if (bytes.size() < size) return {};
  const std::uint16_t sum = checksum(bytes.subspan(1, end - 1), *type);
  if (bytes[end] != (sum & 0xFF) || bytes[end + 1] != sum >> 8) return refuse(counts_.bad_checksum);
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(header), frame.length, frame.payload.begin());
  ++counts_.frames;
  return {size, true};
}

}  // namespace evpose::mavlink
