// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <utility>

#include "evpose/io/files/input_file.h"

namespace evpose {
namespace {

std::string reason(int error) { return std::strerror(error); }

std::string folder_of(const std::string& path) {
  const auto slash = path.rfind('/');
  return slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

int sync_path(const std::string& path, int flags) {
  const int descriptor = ::open(path.c_str(), flags);
  if (descriptor < 0) return errno;
  const int error = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return error;
}

}  // namespace

TemporaryFile::TemporaryFile(std::string target, std::string path)
    : target_(std::move(target)), path_(std::move(path)) {}

TemporaryFile::TemporaryFile(TemporaryFile&& other) noexcept
    : target_(std::move(other.target_)), path_(std::exchange(other.path_, {})) {}

TemporaryFile& TemporaryFile::operator=(TemporaryFile&& other) noexcept {
  if (this == &other) return *this;
  remove();
  target_ = std::move(other.target_);
  path_ = std::exchange(other.path_, {});
  return *this;
}

TemporaryFile::~TemporaryFile() { remove(); }

void TemporaryFile::remove() {
  if (!path_.empty()) ::unlink(path_.c_str());
  path_.clear();
}

Expected<TemporaryFile> TemporaryFile::create(const std::string& target) {
  static std::atomic<unsigned> number{0};
  struct stat info = {};
  if (::stat(target.c_str(), &info) == 0 && S_ISDIR(info.st_mode))
    return Error{target, "is a folder", "name a file"};
  // Names of dead processes may lie about: go on to a free one.
  for (int attempt = 0; attempt < 1000; ++attempt) {
    std::string path = text(target, ".", ::getpid(), "-", number++, ".tmp");
    const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0) {
      ::close(descriptor);
      return TemporaryFile(target, std::move(path));
    }
    if (errno != EEXIST) break;
  }
  return Error{target, "cannot be written: " + reason(errno),
               "check that the folder exists and may be written"};
}

Status TemporaryFile::commit() {
  EVPOSE_CHECK(!path_.empty());
  int error = sync_path(path_, O_RDONLY | O_CLOEXEC);
  if (error == 0 && ::rename(path_.c_str(), target_.c_str()) != 0) error = errno;
  if (error != 0)
    return Error{target_, "cannot be written: " + reason(error), "check the free space and the folder"};
  path_.clear();
  sync_path(folder_of(target_),
            O_RDONLY | O_DIRECTORY | O_CLOEXEC);  // not all file systems can; the name is there
  return {};
}

AtomicFile::AtomicFile(TemporaryFile file, std::FILE* stream) : file_(std::move(file)), stream_(stream) {}

Expected<AtomicFile> AtomicFile::create(const std::string& path) {
  auto file = TemporaryFile::create(path);
  if (!file) return file.error();
  std::FILE* stream = std::fopen(file->path().c_str(), "wbe");
  if (stream == nullptr) return Error{path, "cannot be written: " + reason(errno), "check the folder"};
  return AtomicFile(*std::move(file), stream);
}

void AtomicFile::write(std::string_view bytes) {
  EVPOSE_CHECK(stream_ != nullptr);
  if (error_ == 0 && std::fwrite(bytes.data(), 1, bytes.size(), stream_.get()) != bytes.size())
    error_ = errno != 0 ? errno : EIO;
}

void AtomicFile::overwrite(std::int64_t at, std::string_view bytes) {
  const auto seek = [&](std::int64_t to, int from) {
    errno = 0;
    if (error_ == 0 && ::fseeko(stream_.get(), to, from) != 0) error_ = errno != 0 ? errno : EIO;
  };
  EVPOSE_CHECK(stream_ != nullptr);
  seek(at, SEEK_SET);
  write(bytes);
  seek(0, SEEK_END);
}

Status AtomicFile::commit() {
  EVPOSE_CHECK(stream_ != nullptr);
  errno = 0;
  if (std::fclose(stream_.release()) != 0 && error_ == 0) error_ = errno != 0 ? errno : EIO;
  if (error_ != 0)
    return Error{file_.target(), "cannot be written: " + reason(error_), "check the free space of the disk"};
  return file_.commit();
}

Status write_text_file(const std::string& path, std::string_view content) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(content);
  return file->commit();
}

Expected<std::string> read_text_file(const std::string& path, std::size_t max_bytes) {
  auto file = open_to_read(path);
  if (!file) return file.error();
  if (file->size > static_cast<std::int64_t>(max_bytes))
    return Error{path, text("has ", file->size, " bytes, more than ", max_bytes), "is it the right file?"};
  std::string content(static_cast<std::size_t>(file->size), '\0');
  if (std::fread(content.data(), 1, content.size(), file->stream.get()) != content.size())
    return Error{path, "cannot be read to its end", "check the disk"};
  return content;
}

}  // namespace evpose
