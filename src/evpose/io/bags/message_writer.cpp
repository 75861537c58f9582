// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/message_writer.h"

#include <cstring>

#include "evpose/core/error.h"

namespace evpose {
namespace {
constexpr std::size_t kCdrHead = 4;
}

MessageWriter::MessageWriter(Wire wire) : is_cdr_(wire == Wire::cdr) {
  EVPOSE_CHECK(wire != Wire::other);
  clear();
}

void MessageWriter::clear() {
  data_.clear();
  if (is_cdr_) data_ = {std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
}

template <class T>
void MessageWriter::number(T value) {
  if (is_cdr_)
    while ((data_.size() - kCdrHead) % sizeof(T) != 0) data_.push_back(std::byte{0});
  const std::size_t at = data_.size();
  data_.resize(at + sizeof(T));
  std::memcpy(data_.data() + at, &value, sizeof(T));
}

void MessageWriter::numbers(std::span<const double> values) {
  for (const double value : values) f64(value);
}

void MessageWriter::time(TimeNs t) {
  EVPOSE_CHECK(t >= 0 && t < message_time_end(is_cdr_ ? Wire::cdr : Wire::ros1));
  u32(static_cast<std::uint32_t>(t / kNsPerS));
  u32(static_cast<std::uint32_t>(t % kNsPerS));
}

void MessageWriter::string(std::string_view value) {
  u32(static_cast<std::uint32_t>(value.size() + (is_cdr_ ? 1 : 0)));
  bytes(std::as_bytes(std::span(value)));
  if (is_cdr_) u8(0);
}

void MessageWriter::bytes(std::span<const std::byte> value) {
  data_.insert(data_.end(), value.begin(), value.end());
}

void MessageWriter::byte_sequence(std::span<const std::byte> value) {
  u32(static_cast<std::uint32_t>(value.size()));
  bytes(value);
}

TimeNs message_time_end(Wire wire) {
  return (wire == Wire::cdr ? std::int64_t{1} << 31 : std::int64_t{1} << 32) * kNsPerS;
}

template void MessageWriter::number(std::uint8_t);
template void MessageWriter::number(std::uint16_t);
template void MessageWriter::number(std::uint32_t);
template void MessageWriter::number(std::uint64_t);
template void MessageWriter::number(double);

}  // namespace evpose
