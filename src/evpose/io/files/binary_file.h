// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "evpose/io/files/input_file.h"

namespace evpose {

/// A file read piece by piece; knows where it is and how much is left.
class BinaryFile {
 public:
  static Expected<BinaryFile> open(const std::string& path);

  /// The next bytes into the front of `room`, which grows as needed. False, and nothing read, when the file
  /// has fewer left.
  Expected<bool> read(std::size_t count, std::vector<std::byte>& room);
  /// `to` is inside the file or its end.
  Status seek(std::int64_t to);

  const std::string& path() const { return file_.path; }
  std::int64_t size() const { return file_.size; }
  std::int64_t position() const { return position_; }
  std::uint64_t left() const { return static_cast<std::uint64_t>(file_.size - position_); }

 private:
  explicit BinaryFile(InputFile file) : file_(std::move(file)) {}

  InputFile file_;
  std::int64_t position_ = 0;
};

}  // namespace evpose
