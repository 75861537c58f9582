// SPDX-License-Identifier: BSD-3-Clause
#include "sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace evpose {

void Sheet::section(const std::string& title, const std::string& key) {
  sections_.push_back({title, {}});
  key_ = key;
}

void Sheet::row(const std::string& label, const std::string& text, const std::string& key,
                nlohmann::ordered_json value) {
  if (!text.empty()) sections_.back().lines.push_back({label, text});
  if (!key.empty()) (key_.empty() ? json_ : json_[key_])[key] = std::move(value);
}

std::string Sheet::text() const {
  std::string out;
  for (const Section& section : sections_) {
    if (section.lines.empty()) continue;
    out += (out.empty() ? "" : "\n") + section.title + "\n";
    for (const Line& line : section.lines) {
      std::string label = line.label;
      label.resize(std::max<std::size_t>(label.size() + 1, 13), ' ');
      out += "  " + label + line.text + "\n";
    }
  }
  if (findings_.empty()) return out;
  out += "\nfindings\n";
  for (const Error& finding : findings_) out += "  - " + finding.line() + "\n";
  return out;
}

std::string Sheet::json() const {
  nlohmann::ordered_json all = json_;
  all["findings"] = nlohmann::ordered_json::array();
  for (const Error& finding : findings_)
    all["findings"].push_back({{"where", finding.where}, {"what", finding.what}, {"fix", finding.fix}});
  // Names come from files and need not be UTF-8.
  return all.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string sparkline(const std::vector<double>& values) {
  constexpr std::array<const char*, 8> kBlocks = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const double most = values.empty() ? 0 : *std::max_element(values.begin(), values.end());
  std::string out;
  for (const double value : values) {
    if (!(value > 0)) {
      out += ' ';
      continue;
    }
    out += kBlocks[static_cast<std::size_t>(std::clamp(std::ceil(8 * value / most) - 1, 0.0, 7.0))];
  }
  return out;
}

std::string fixed(double value, int decimals) {
  std::array<char, 400> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%.*f", decimals, value);
  return buffer.data();
}

}  // namespace evpose
