// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "evpose/core/time.h"

namespace evpose {

/// How a message's fields are laid out.
enum class Wire : std::uint8_t {
  ros1,  ///< packed, little-endian
  cdr,   ///< ROS 2: a head of four bytes, fields aligned to their size
  other
};

/// Takes the fields of a message one by one. Reads beyond the end give zeros and empty views and make ok()
/// false for good, so that a message is read through first and judged once.
class MessageReader {
 public:
  /// Packed little-endian numbers; strings without terminator.
  explicit MessageReader(std::span<const std::byte> data) : data_(data) {}
  /// CDR of either byte order, XCDR1 or plain XCDR2, if that is what the wire says. Not ok() for other heads.
  MessageReader(std::span<const std::byte> data, Wire wire);

  std::uint8_t u8() { return number<std::uint8_t>(); }
  std::uint16_t u16() { return number<std::uint16_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  std::uint64_t u64() { return number<std::uint64_t>(); }
  std::int32_t i32() { return number<std::int32_t>(); }
  double f64() { return number<double>(); }
  /// Seconds and nanoseconds; ROS 2 counts seconds with a sign.
  TimeNs time();
  /// The views hold as long as the message.
  std::string_view string();
  std::span<const std::byte> bytes(std::size_t count);
  /// A count and as many bytes.
  std::span<const std::byte> byte_sequence() { return bytes(u32()); }
  void skip(std::size_t count) { bytes(count); }

  bool ok() const { return ok_; }
  std::size_t left() const { return data_.size() - position_; }
  bool is_cdr() const { return largest_alignment_ > 1; }
  bool swapped() const { return swapped_; }
  /// Of the next byte, from the place that alignment counts from.
  std::size_t position() const { return position_; }
  std::span<const std::byte> whole() const { return data_; }
  std::span<const std::byte> rest() const { return data_.subspan(position_); }

 private:
  template <class T>
  T number();
  void align(std::size_t size);

  std::span<const std::byte> data_;
  std::size_t position_ = 0;
  std::size_t largest_alignment_ = 1;
  bool swapped_ = false, ok_ = true;
};

}  // namespace evpose
