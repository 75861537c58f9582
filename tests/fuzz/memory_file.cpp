// SPDX-License-Identifier: BSD-3-Clause
// One file in memory, for readers that open files by name: stat() and fopen() of the program are bound to
// those here by the linker (--wrap). On a real file a try would cost ten times as much, all in the kernel.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "evpose/core/error.h"
#include "fuzz.h"

namespace {

constexpr const char* kName = "memory/fuzz";
evpose::fuzz::Bytes content;

bool is_memory(const char* path) { return std::strcmp(path, kName) == 0; }

}  // namespace

extern "C" {

int __real_stat(const char* path, struct stat* info);         // NOLINT(bugprone-reserved-identifier)
std::FILE* __real_fopen(const char* path, const char* mode);  // NOLINT(bugprone-reserved-identifier)
int __wrap_stat(const char* path, struct stat* info);         // NOLINT(bugprone-reserved-identifier)
std::FILE* __wrap_fopen(const char* path, const char* mode);  // NOLINT(bugprone-reserved-identifier)

int __wrap_stat(const char* path, struct stat* info) {  // NOLINT(bugprone-reserved-identifier)
  if (!is_memory(path)) return __real_stat(path, info);
  *info = {};
  info->st_mode = S_IFREG | 0444;
  info->st_size = static_cast<off_t>(content.size());
  return 0;
}

std::FILE* __wrap_fopen(const char* path, const char* mode) {  // NOLINT(bugprone-reserved-identifier)
  if (!is_memory(path)) return __real_fopen(path, mode);
  static std::uint8_t nothing = 0;
  void* const data = content.empty() ? &nothing : const_cast<std::uint8_t*>(content.data());
  return ::fmemopen(data, content.size(), "r");
}

}  // extern "C"

namespace evpose::fuzz {

std::string as_file(Bytes bytes) {
  content = bytes;
  return kName;
}

std::string as_real_file(Bytes bytes) {
  namespace fs = std::filesystem;
  static const std::string path = [] {
    std::error_code ignored;
    const fs::path memory = "/dev/shm";
    const fs::path folder = fs::is_directory(memory, ignored) ? memory : fs::temp_directory_path();
    return (folder / ("evpose-fuzz-" + std::to_string(::getpid()))).string();
  }();
  static const int registered = std::atexit([] { ::unlink(path.c_str()); });
  EVPOSE_CHECK(registered == 0);
  // A new file each time: the HDF5 library takes what it has not closed yet for the same file.
  ::unlink(path.c_str());
  const int descriptor = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600);
  EVPOSE_CHECK(descriptor >= 0);
  EVPOSE_CHECK(::write(descriptor, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
  ::close(descriptor);
  return path;
}

}  // namespace evpose::fuzz
