// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// A regular file, open to be read.
struct InputFile {
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string path;
  std::unique_ptr<std::FILE, Close> stream;
  std::int64_t size = 0;  ///< bytes
};
/// Errors: no such file, a folder, not readable.
Expected<InputFile> open_to_read(const std::string& path);

/// The first bytes of a file, at most so many: what its format is told by. Errors: as of open_to_read().
Expected<std::string> first_bytes(const std::string& path, std::size_t most);

/// Lines of a text file in bounded memory.
class LineReader {
 public:
  static Expected<LineReader> open(const std::string& path);

  /// The next line without its end (\n or \r\n); the view holds until the next call. False at the end of the
  /// file. Errors: a line of more than 64 KiB, which is no text.
  Expected<bool> next(std::string_view& line);

  /// All whole lines that follow and are in memory already, each with its end; empty when there is none, as
  /// at the end of the file. They are still to be given by next(), unless skip() takes them.
  std::string_view whole_lines();
  /// Of whole_lines(), so many bytes, which are so many lines.
  void skip(std::size_t bytes, std::int64_t lines);

  std::int64_t number() const { return number_; }  ///< of the line given last, from 1
  std::int64_t offset() const { return offset_; }  ///< bytes up to the end of the line given last
  std::int64_t size() const { return file_.size; }
  std::string where() const { return text(file_.path, ":", number_); }

 private:
  explicit LineReader(InputFile file) : file_(std::move(file)) {}
  bool refill();

  InputFile file_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;  ///< unread part of the buffer
  std::int64_t number_ = 0, offset_ = 0;
};

}  // namespace evpose
