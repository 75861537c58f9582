// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "evpose/io/bags/message_reader.h"

namespace evpose {

/// Puts the fields of a message one behind the other: what MessageReader takes apart.
class MessageWriter {
 public:
  /// Packed, or CDR: XCDR1, little-endian, with its head.
  explicit MessageWriter(Wire wire = Wire::ros1);

  /// An empty message again; the room is kept.
  void clear();

  void u8(std::uint8_t value) { number(value); }
  void u16(std::uint16_t value) { number(value); }
  void u32(std::uint32_t value) { number(value); }
  void u64(std::uint64_t value) { number(value); }
  void f64(double value) { number(value); }
  void numbers(std::span<const double> values);
  /// Seconds from 0 to 2^31 (ROS 2) or 2^32 (ROS 1): a fault of ours otherwise.
  void time(TimeNs t);
  void string(std::string_view value);
  void bytes(std::span<const std::byte> value);
  /// A count and as many bytes.
  void byte_sequence(std::span<const std::byte> value);
  void byte_sequence(std::string_view value) { byte_sequence(std::as_bytes(std::span(value))); }

  std::span<const std::byte> data() const { return data_; }
  std::size_t size() const { return data_.size(); }

 private:
  template <class T>
  void number(T value);

  std::vector<std::byte> data_;
  bool is_cdr_;
};

/// The first time that messages cannot carry, ns; the first that they can is 0.
TimeNs message_time_end(Wire wire);

}  // namespace evpose
