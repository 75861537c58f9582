// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/message_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace evpose {

static_assert(std::endian::native == std::endian::little, "files and memory have the same byte order");

MessageReader::MessageReader(std::span<const std::byte> data, Wire wire) : data_(data) {
  if (wire == Wire::ros1) return;
  if (wire == Wire::other || data.size() < 4) {
    ok_ = false;
    return;
  }
  // 0x0000, 0x0001: XCDR1, big-endian and little-endian; 0x0006, 0x0007: the same of plain XCDR2.
  const unsigned kind = std::to_integer<unsigned>(data[0]) << 8 | std::to_integer<unsigned>(data[1]);
  ok_ = kind <= 1 || kind == 6 || kind == 7;
  swapped_ = (kind & 1) == 0;
  largest_alignment_ = kind <= 1 ? 8 : 4;
  data_ = data.subspan(4);
}

void MessageReader::align(std::size_t size) {
  const std::size_t alignment = std::min(size, largest_alignment_);
  const std::size_t padding = (alignment - position_ % alignment) % alignment;
  if (padding > left())
    ok_ = false;
  else
    position_ += padding;
}

template <class T>
T MessageReader::number() {
  align(sizeof(T));
  std::array<std::byte, sizeof(T)> raw{};
  const auto from = bytes(sizeof(T));
  if (from.empty()) return T{};
  std::memcpy(raw.data(), from.data(), sizeof(T));
  if (swapped_) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

TimeNs MessageReader::time() {
  const std::int64_t seconds = is_cdr() ? i32() : static_cast<std::int64_t>(u32());
  return seconds * kNsPerS + u32();
}

std::span<const std::byte> MessageReader::bytes(std::size_t count) {
  if (!ok_ || count > left()) {
    ok_ = false;
    return {};
  }
  const auto out = data_.subspan(position_, count);
  position_ += count;
  return out;
}

std::string_view MessageReader::string() {
  const auto raw = byte_sequence();
  std::string_view out(reinterpret_cast<const char*>(raw.data()), raw.size());
  if (is_cdr() && out.ends_with('\0')) out.remove_suffix(1);
  return out;
}

template std::uint8_t MessageReader::number();
template std::uint16_t MessageReader::number();
template std::uint32_t MessageReader::number();
template std::uint64_t MessageReader::number();
template std::int32_t MessageReader::number();
template double MessageReader::number();

}  // namespace evpose
