// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "evpose/io/files/atomic_file.h"

namespace evpose {

/// A folder of one test's own, gone with it.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "evpose-io-XXXXXX").string();
    EVPOSE_CHECK(::mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  /// Path of a new file with the content. Not synced to the disk: tests write thousands.
  std::string file(const std::string& name, std::string_view content) const {
    std::FILE* stream = std::fopen((*this / name).c_str(), "wb");
    EVPOSE_CHECK(stream != nullptr);
    EVPOSE_CHECK(std::fwrite(content.data(), 1, content.size(), stream) == content.size());
    EVPOSE_CHECK(std::fclose(stream) == 0);
    return *this / name;
  }
  std::size_t entries() const {
    std::size_t n = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(path_)) ++n;
    return n;
  }

 private:
  std::string path_;
};

inline std::string content_of(const std::string& path) { return read_text_file(path).value(); }

/// The shared data: EVPOSE_SHARED, else beside the sources.
inline std::string shared_folder() {
  const char* variable = std::getenv("EVPOSE_SHARED");
  return variable != nullptr ? variable : EVPOSE_SOURCE_DIR "/../shared";
}

/// The error line of what must fail; a success reads as such.
template <class T>
std::string error_line(const Expected<T>& result) {
  return result.ok() ? "(no error)" : result.error().line();
}

inline ::testing::AssertionResult says(const std::string& line, std::initializer_list<const char*> parts) {
  for (const char* part : parts)
    if (line.find(part) == std::string::npos)
      return ::testing::AssertionFailure() << "'" << part << "' is not in: " << line;
  return ::testing::AssertionSuccess();
}

/// Any sound ending of reading a spoilt file: a value, or an error of one line that names the file.
template <class T>
void expect_no_harm(const Expected<T>& result, const std::string& path, std::size_t at) {
  if (result.ok()) return;
  EXPECT_TRUE(says(result.error().line(), {path.c_str()})) << at;
  EXPECT_FALSE(result.error().what.empty()) << at;
}

}  // namespace evpose

/// Skips a test for want of a file or folder of the shared data, by name.
#define EVPOSE_NEEDS_SHARED(path) \
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << (path)
