// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/row_reader.h"

#include <cmath>

#include "evpose/io/files/numbers.h"

namespace evpose {

Expected<RowReader> RowReader::open(const std::string& path) {
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  return RowReader(*std::move(lines));
}

Expected<bool> RowReader::next() {
  comments_.clear();
  while (true) {
    const auto more = lines_.next(line_);
    if (!more || !*more) return more;
    line_ = trimmed(line_);
    if (line_.starts_with('#')) comments_.emplace_back(line_.substr(1));
    if (line_.empty() || line_.front() == '#') continue;
    split_fields(line_, fields_);
    return true;
  }
}

Status RowReader::numbers(std::size_t first, std::span<double> out, const std::string& remedy) const {
  EVPOSE_CHECK(first + out.size() <= fields_.size());
  for (std::size_t k = 0; k < out.size(); ++k)
    if (!parse_number(fields_[first + k], out[k]) || !std::isfinite(out[k]))
      return Error{where(), text("'", fields_[first + k], "' is not a finite number"), remedy};
  return {};
}

}  // namespace evpose
