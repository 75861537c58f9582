// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/numbers.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

namespace evpose {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

template <class T>
bool parse_whole(std::string_view s, T& out) {
  if (s.starts_with('+')) {
    s.remove_prefix(1);
    if (s.starts_with('-')) return false;
  }
  T value{};
  const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
  if (error != std::errc() || end != s.data() + s.size()) return false;
  out = value;
  return true;
}

}  // namespace

bool parse_number(std::string_view s, double& out) { return parse_whole(s, out); }
bool parse_integer(std::string_view s, std::int64_t& out) { return parse_whole(s, out); }

bool parse_decimal(std::string_view s, int decimals, std::int64_t& out) {
  const bool negative = s.starts_with('-');
  if (negative || s.starts_with('+')) s.remove_prefix(1);
  std::int64_t exponent = 0;
  if (const auto e = s.find_first_of("eE"); e != std::string_view::npos) {
    if (!parse_integer(s.substr(e + 1), exponent) || exponent < -1000 || exponent > 1000) return false;
    s = s.substr(0, e);
  }
  const auto point = s.find('.');
  const std::string_view whole = s.substr(0, point);
  const std::string_view fraction =
      point == std::string_view::npos ? std::string_view() : s.substr(point + 1);
  if (whole.empty() && fraction.empty()) return false;
  // Digits before place `units` of whole + fraction count; of those behind only matters whether any is not
  // zero.
  const std::int64_t units = static_cast<std::int64_t>(whole.size()) + exponent + decimals;
  const auto digits = static_cast<std::int64_t>(whole.size() + fraction.size());
  std::int64_t value = 0;
  bool rest = false;
  for (std::int64_t i = 0; i < std::max(digits, units); ++i) {
    const auto place = static_cast<std::size_t>(i);
    const char c = i >= digits ? '0' : place < whole.size() ? whole[place] : fraction[place - whole.size()];
    if (!is_digit(c)) return false;
    if (i >= units) {
      rest |= c != '0';
    } else if (__builtin_mul_overflow(value, std::int64_t{10}, &value) ||
               __builtin_add_overflow(value, std::int64_t{c - '0'}, &value)) {
      return false;
    }
  }
  out = negative ? -value - (rest ? 1 : 0) : value;
  return true;
}

void split_fields(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  const bool commas = line.find(',') != std::string_view::npos;
  std::size_t i = 0;
  while (i < line.size()) {
    if (commas) {
      const std::size_t comma = std::min(line.find(',', i), line.size());
      fields.push_back(trimmed(line.substr(i, comma - i)));
      if (comma + 1 == line.size()) fields.emplace_back();
      i = comma + 1;
      continue;
    }
    while (i < line.size() && is_blank(line[i])) ++i;
    const std::size_t begin = i;
    while (i < line.size() && !is_blank(line[i])) ++i;
    if (i > begin) fields.push_back(line.substr(begin, i - begin));
  }
}

std::string_view trimmed(std::string_view s) {
  while (!s.empty() && is_blank(s.front())) s.remove_prefix(1);
  while (!s.empty() && is_blank(s.back())) s.remove_suffix(1);
  return s;
}

std::string lower_case(std::string_view s) {
  std::string out(s);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

std::string format_decimal(std::int64_t value, int decimals) {
  // Through unsigned: the most negative number has no positive twin.
  const std::uint64_t magnitude =
      value < 0 ? 0 - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
  std::string digits = std::to_string(magnitude);
  if (digits.size() <= static_cast<std::size_t>(decimals))
    digits.insert(0, static_cast<std::size_t>(decimals) + 1 - digits.size(), '0');
  if (decimals > 0) digits.insert(digits.size() - static_cast<std::size_t>(decimals), 1, '.');
  return (value < 0 ? "-" : "") + digits;
}

void append_number(std::string& line, char separator, double value, int decimals) {
  std::array<char, 352> buffer{};  // the largest double has 309 digits before the point
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed, decimals)
          .ptr;
  line += separator;
  line.append(buffer.data(), end);
}

}  // namespace evpose
