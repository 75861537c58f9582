// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/files/input_file.h"

namespace evpose {

enum class PlyFormat { ascii, little, big };
enum class PlyType { i8, u8, i16, u16, i32, u32, f32, f64 };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::f32;
  std::optional<PlyType> count_type;  ///< of a list
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  const PlyProperty* find(const std::string& property) const;
};

/// A PLY file read in order: the header at once, then row by row.
class PlyFile {
 public:
  /// Errors: no PLY, a header that is not understood (line), or more content promised than the file holds
  /// (bytes).
  static Expected<PlyFile> open(const std::string& path);

  const std::string& path() const { return path_; }
  const std::vector<PlyElement>& elements() const { return elements_; }

  /// Values of the next row of `element`, lists as one entry each in `lists`. Rows must be asked for in the
  /// order of the file, each once. Errors: the file ends, or not a number (line).
  Status read_row(const PlyElement& element, std::vector<double>& values,
                  std::vector<std::vector<double>>& lists);
  /// After the last row. Errors: something follows.
  Status finish();

 private:
  Status read_header();
  Status add_header_line(const std::vector<std::string_view>& words);
  Status check_size();
  Error header_error(const std::string& what) const;
  Status read_binary(const PlyElement& element, std::vector<double>& values,
                     std::vector<std::vector<double>>& lists);
  Status read_ascii(const PlyElement& element, std::vector<double>& values,
                    std::vector<std::vector<double>>& lists);
  bool scalar(PlyType type, double& out);
  Status list(const PlyProperty& property, std::vector<double>& out);
  Error ended() const;

  explicit PlyFile(LineReader lines) : lines_(std::move(lines)) {}

  std::string path_;
  LineReader lines_;
  InputFile binary_;
  PlyFormat format_ = PlyFormat::ascii;
  std::vector<PlyElement> elements_;
  std::int64_t data_bytes_ = 0;  ///< after the header
  std::int64_t read_bytes_ = 0;  ///< of these, consumed; binary only
  std::vector<std::string_view> words_;
};

}  // namespace evpose
