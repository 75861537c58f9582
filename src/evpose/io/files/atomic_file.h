// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "evpose/core/error.h"

namespace evpose {

/// A temporary name beside a target, for libraries that open files themselves. Whoever finds the target finds
/// either the old file or the whole new one. Unless committed, the temporary file is removed again.
class TemporaryFile {
 public:
  /// Creates an empty file. Errors: the folder does not exist or cannot be written, or `target` is a folder.
  static Expected<TemporaryFile> create(const std::string& target);
  TemporaryFile(TemporaryFile&& other) noexcept;
  TemporaryFile& operator=(TemporaryFile&& other) noexcept;
  ~TemporaryFile();

  const std::string& path() const { return path_; }
  const std::string& target() const { return target_; }
  /// Flushes to the disk and renames onto the target. Whoever wrote to path() has closed it.
  Status commit();

 private:
  TemporaryFile(std::string target, std::string path);
  void remove();

  std::string target_, path_;  ///< path_ is empty once committed or moved from
};

/// Buffered output that replaces `path` when committed. Errors of writing are kept and told by commit().
class AtomicFile {
 public:
  static Expected<AtomicFile> create(const std::string& path);

  void write(std::string_view bytes);
  /// Replaces what was written at byte `at`; writing goes on at the end.
  void overwrite(std::int64_t at, std::string_view bytes);
  Status commit();

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  AtomicFile(TemporaryFile file, std::FILE* stream);

  TemporaryFile file_;
  std::unique_ptr<std::FILE, Close> stream_;
  int error_ = 0;  ///< errno of the first failed write
};

/// Replaces the file at `path` with `content`.
Status write_text_file(const std::string& path, std::string_view content);

/// The whole of a small text file. Errors: it cannot be read, or is larger than `max_bytes`.
Expected<std::string> read_text_file(const std::string& path, std::size_t max_bytes = 64u << 20);

}  // namespace evpose
