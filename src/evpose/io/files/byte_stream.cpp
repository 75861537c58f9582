// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/byte_stream.h"

#include <algorithm>

namespace evpose {
namespace {
constexpr std::size_t kLeastBuffer = 256 << 10;
}

Expected<ByteStream> ByteStream::open(const std::string& path) {
  auto file = open_to_read(path);
  if (!file) return file.error();
  std::setvbuf(file->stream.get(), nullptr, _IONBF, 0);  // the buffer is ours
  return ByteStream(*std::move(file));
}

std::span<const std::byte> ByteStream::peek(std::size_t wanted) {
  const std::size_t held = end_ - begin_;
  // What the file does not have need not be asked for.
  wanted = static_cast<std::size_t>(
      std::min<std::uint64_t>(wanted, static_cast<std::uint64_t>(std::max<std::int64_t>(left(), 0))));
  if (held < wanted) {
    if (begin_ > 0) std::memmove(buffer_.data(), buffer_.data() + begin_, held);
    begin_ = 0;
    end_ = held;
    const std::size_t room = std::max(wanted, std::min(kLeastBuffer, static_cast<std::size_t>(left())));
    if (buffer_.size() < room) buffer_.resize(room);
    while (end_ < wanted) {
      const std::size_t got = std::fread(buffer_.data() + end_, 1, buffer_.size() - end_, file_.stream.get());
      if (got == 0) break;
      end_ += got;
    }
  }
  return {buffer_.data() + begin_, end_ - begin_};
}

void ByteStream::skip(std::size_t count) {
  position_ += static_cast<std::int64_t>(count);
  const std::size_t held = end_ - begin_;
  if (count <= held) {
    begin_ += count;
    return;
  }
  begin_ = end_ = 0;
  ::fseeko(file_.stream.get(), std::min(position_, file_.size), SEEK_SET);
}

bool ByteStream::take_line(std::string_view prefix, std::string& line, std::size_t most) {
  std::string_view view;
  std::size_t newline = std::string_view::npos;
  for (std::size_t wanted = std::min<std::size_t>(most, 4096);; wanted = std::min(wanted * 4, most)) {
    view = as_text(peek(wanted)).substr(0, most);
    if (!view.starts_with(prefix)) return false;
    newline = view.find('\n');
    if (newline != std::string_view::npos || wanted >= most || view.size() < wanted) break;
  }
  if (newline == std::string_view::npos) return false;
  line = view.substr(0, newline);
  if (line.ends_with('\r')) line.pop_back();
  skip(newline + 1);
  return true;
}

std::string_view as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace evpose
