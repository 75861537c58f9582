// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "evpose/io/files/input_file.h"

namespace evpose {

/// The bytes of a file in order, through a buffer that is as large as the largest piece asked for.
class ByteStream {
 public:
  static Expected<ByteStream> open(const std::string& path);

  const std::string& path() const { return file_.path; }
  std::int64_t size() const { return file_.size; }
  std::int64_t position() const { return position_; }  ///< of the next byte, from 0
  std::int64_t left() const { return file_.size - position_; }

  /// The next bytes, `wanted` of them or more; fewer only where the file ends. Holds until the next call.
  std::span<const std::byte> peek(std::size_t wanted);
  void skip(std::size_t count);

  /// The next line that ends by \n within `most` bytes, without \n or \r\n; skipped if it starts with
  /// `prefix`, otherwise the result is false and nothing is skipped.
  bool take_line(std::string_view prefix, std::string& line, std::size_t most = 64 << 10);

 private:
  explicit ByteStream(InputFile file) : file_(std::move(file)) {}

  InputFile file_;
  std::vector<std::byte> buffer_;
  std::size_t begin_ = 0, end_ = 0;  ///< unread part of the buffer
  std::int64_t position_ = 0;
};

/// A number as it lies in memory: files and machine are little-endian.
template <class T>
T load(std::span<const std::byte> bytes, std::size_t at = 0) {
  T value{};
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

std::string_view as_text(std::span<const std::byte> bytes);

}  // namespace evpose
