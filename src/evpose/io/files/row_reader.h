// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evpose/io/files/input_file.h"

namespace evpose {

/// Rows of values in a text file, split as by split_fields(). Empty lines and `#` comments are passed over.
class RowReader {
 public:
  static Expected<RowReader> open(const std::string& path);
  /// Of a file whose first lines were read already.
  explicit RowReader(LineReader lines) : lines_(std::move(lines)) {}

  /// Goes to the next row; false at the end. Errors: as of LineReader.
  Expected<bool> next();

  /// Of the row gone to last; views hold until the next call of next().
  std::string_view line() const { return line_; }
  const std::vector<std::string_view>& fields() const { return fields_; }
  /// The comments between the row before and this one, without their `#`.
  const std::vector<std::string>& comments() const { return comments_; }
  std::int64_t number() const { return lines_.number(); }
  std::string where() const { return lines_.where(); }

  /// The fields from `first` on as numbers; as many as `out` has room for, which the row must hold. Errors:
  /// one is not a finite number.
  Status numbers(std::size_t first, std::span<double> out, const std::string& remedy) const;

 private:
  LineReader lines_;
  std::string_view line_;
  std::vector<std::string_view> fields_;
  std::vector<std::string> comments_;
};

}  // namespace evpose
