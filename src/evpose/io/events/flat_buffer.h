// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "evpose/io/files/byte_stream.h"

namespace evpose {

class FlatVector;

/// A table of a FlatBuffers message. Every offset is held against the buffer; what lies outside reads as
/// absent, and an absent number as its default.
class FlatTable {
 public:
  /// The root of a message of that identifier (4 characters).
  static std::optional<FlatTable> root(std::span<const std::byte> buffer, std::string_view identifier);
  /// The table at a position of the buffer.
  static std::optional<FlatTable> at(std::span<const std::byte> buffer, std::size_t position);

  template <class T>
  T number(unsigned slot, T absent = {}) const {
    const std::size_t position = field(slot, sizeof(T));
    return position == 0 ? absent : load<T>(buffer_, position);
  }
  /// Of structs of `item_bytes`, of numbers, of characters, or of offsets to tables (4 bytes).
  std::optional<FlatVector> vector(unsigned slot, std::size_t item_bytes) const;

 private:
  FlatTable(std::span<const std::byte> buffer, std::size_t position, std::size_t fields, std::size_t slots,
            std::size_t bytes)
      : buffer_(buffer), position_(position), fields_(fields), slots_(slots), bytes_(bytes) {}
  /// Position of a field of that size; 0 if it is absent.
  std::size_t field(unsigned slot, std::size_t size) const;

  std::span<const std::byte> buffer_;
  std::size_t position_, fields_, slots_, bytes_;
};

class FlatVector {
 public:
  FlatVector(std::span<const std::byte> buffer, std::size_t position, std::size_t count,
             std::size_t item_bytes)
      : buffer_(buffer), position_(position), count_(count), item_bytes_(item_bytes) {}

  std::size_t size() const { return count_; }
  std::span<const std::byte> bytes() const { return buffer_.subspan(position_, count_ * item_bytes_); }
  /// The table that the i-th offset points to.
  std::optional<FlatTable> table(std::size_t i) const;

 private:
  std::span<const std::byte> buffer_;
  std::size_t position_, count_, item_bytes_;
};

}  // namespace evpose
