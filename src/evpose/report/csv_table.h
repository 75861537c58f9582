// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string_view>
#include <vector>

namespace evpose {

/// A CSV file of our own by columns; quoted text stands only at the end of a line. Keeps views of its text.
struct CsvTable {
  std::map<std::string_view, std::size_t, std::less<>> columns;
  std::vector<std::vector<std::string_view>> rows;

  explicit CsvTable(std::string_view content = {});
};

/// Reads cells of a row by the names of their columns.
class CsvRow {
 public:
  CsvRow(const CsvTable& table, const std::vector<std::string_view>& cells) : table_(table), cells_(cells) {}
  /// False once a cell was not there or no number.
  bool sound() const { return sound_; }
  std::string_view word(std::string_view name);
  double number(std::string_view name);
  /// Seconds with decimals, to ns.
  std::int64_t stamp_ns(std::string_view name);
  /// The line from this cell on, without quotes around it.
  std::string_view rest(std::string_view name);

 private:
  const CsvTable& table_;
  const std::vector<std::string_view>& cells_;
  bool sound_ = true;
};

}  // namespace evpose
