// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/csv_table.h"

#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> out;
  while (true) {
    const auto comma = line.find(',');
    out.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return out;
    line.remove_prefix(comma + 1);
  }
}

}  // namespace

CsvTable::CsvTable(std::string_view content) {
  for (bool first = true; !content.empty(); first = false) {
    const auto end = content.find('\n');
    auto cells = cells_of(content.substr(0, end));
    if (first)
      for (std::size_t i = 0; i < cells.size(); ++i) columns.emplace(cells[i], i);
    else
      rows.push_back(std::move(cells));
    if (end == std::string_view::npos) break;
    content.remove_prefix(end + 1);
  }
}

std::string_view CsvRow::word(std::string_view name) {
  const auto found = table_.columns.find(name);
  if (found != table_.columns.end() && found->second < cells_.size()) return cells_[found->second];
  sound_ = false;
  return {};
}

double CsvRow::number(std::string_view name) {
  double value = 0;
  if (!parse_number(word(name), value)) sound_ = false;
  return value;
}

std::int64_t CsvRow::stamp_ns(std::string_view name) {
  std::int64_t value = 0;
  if (!parse_decimal(word(name), 9, value)) sound_ = false;
  return value;
}

std::string_view CsvRow::rest(std::string_view name) {
  const std::string_view first = word(name);
  if (first.data() == nullptr) return {};
  const std::string_view last = cells_.back();
  std::string_view out(first.data(), static_cast<std::size_t>(last.data() + last.size() - first.data()));
  if (out.size() >= 2 && out.front() == '"' && out.back() == '"') out = out.substr(1, out.size() - 2);
  return out;
}

}  // namespace evpose
