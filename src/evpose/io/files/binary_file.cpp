// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/binary_file.h"

namespace evpose {

Expected<BinaryFile> BinaryFile::open(const std::string& path) {
  auto file = open_to_read(path);
  if (!file) return file.error();
  return BinaryFile(*std::move(file));
}

Expected<bool> BinaryFile::read(std::size_t count, std::vector<std::byte>& room) {
  if (count > left()) return false;
  if (room.size() < count) room.resize(count);
  if (std::fread(room.data(), 1, count, file_.stream.get()) != count)
    return Error{text(path(), ", byte ", position_), "cannot be read", "check the disk"};
  position_ += static_cast<std::int64_t>(count);
  return true;
}

Status BinaryFile::seek(std::int64_t to) {
  EVPOSE_CHECK(to >= 0 && to <= file_.size);
  if (to == position_) return {};
  if (::fseeko(file_.stream.get(), to, SEEK_SET) != 0)
    return Error{text(path(), ", byte ", to), "cannot be read", "check the disk"};
  position_ = to;
  return {};
}

}  // namespace evpose
