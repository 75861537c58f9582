// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/input_file.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace evpose {
namespace {
constexpr std::size_t kLongestLine = 64 << 10;
constexpr std::size_t kBuffer = 4 * kLongestLine;
}  // namespace

Expected<InputFile> open_to_read(const std::string& path) {
  struct stat info = {};
  if (::stat(path.c_str(), &info) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) return Error{path, "no such file", "check the path"};
    return Error{path, std::string("cannot be read: ") + std::strerror(errno),
                 "check the path and its rights"};
  }
  if (S_ISDIR(info.st_mode)) return Error{path, "is a folder", "name a file"};
  if (!S_ISREG(info.st_mode)) return Error{path, "is not a regular file", "copy it to a file first"};
  InputFile file{path, nullptr, info.st_size};
  file.stream.reset(std::fopen(path.c_str(), "rbe"));
  if (file.stream == nullptr)
    return Error{path, std::string("cannot be read: ") + std::strerror(errno), "check its rights"};
  return file;
}

Expected<std::string> first_bytes(const std::string& path, std::size_t most) {
  const auto file = open_to_read(path);
  if (!file) return file.error();
  std::string bytes(std::min(most, static_cast<std::size_t>(file->size)), '\0');
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file->stream.get()));
  return bytes;
}

Expected<LineReader> LineReader::open(const std::string& path) {
  auto file = open_to_read(path);
  if (!file) return file.error();
  return LineReader(*std::move(file));
}

bool LineReader::refill() {
  // A small file, as calibrations are, needs no more room than it has bytes.
  if (buffer_.empty())
    buffer_.resize(std::clamp(static_cast<std::size_t>(file_.size) + 1, kLongestLine / 16, kBuffer));
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  const std::size_t got = std::fread(buffer_.data() + end_, 1, buffer_.size() - end_, file_.stream.get());
  end_ += got;
  return got > 0;
}

Expected<bool> LineReader::next(std::string_view& line) {
  std::size_t searched = 0;
  const char* newline = nullptr;
  while (true) {
    const std::size_t left = end_ - begin_ - searched;
    if (left > 0)
      newline = static_cast<const char*>(std::memchr(buffer_.data() + begin_ + searched, '\n', left));
    if (newline != nullptr) break;
    searched = end_ - begin_;
    if (searched > kLongestLine)
      return Error{text(file_.path, ":", number_ + 1),
                   text("a line of more than ", kLongestLine, " characters"), "is it a text file?"};
    if (!refill()) break;
  }
  if (newline == nullptr && begin_ == end_) return false;
  const std::size_t stop = newline != nullptr ? static_cast<std::size_t>(newline - buffer_.data()) : end_;
  line = std::string_view(buffer_.data() + begin_, stop - begin_);
  const std::size_t after = newline != nullptr ? stop + 1 : stop;
  offset_ += static_cast<std::int64_t>(after - begin_);
  begin_ = after;
  ++number_;
  if (line.ends_with('\r')) line.remove_suffix(1);
  return true;
}

std::string_view LineReader::whole_lines() {
  if (begin_ == end_ && !refill()) return {};
  const std::string_view held(buffer_.data() + begin_, end_ - begin_);
  return held.substr(0, held.rfind('\n') + 1);
}

void LineReader::skip(std::size_t bytes, std::int64_t lines) {
  EVPOSE_CHECK(bytes <= end_ - begin_);
  begin_ += bytes;
  offset_ += static_cast<std::int64_t>(bytes);
  number_ += lines;
}

}  // namespace evpose
