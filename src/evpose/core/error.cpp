// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/error.h"

#include <algorithm>
#include <string_view>

namespace evpose {
namespace {

/// Bytes of the character that the text begins with; 0: it is not UTF-8.
std::size_t character_bytes(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  const std::size_t n = lead < 0x80                    ? 1
                        : lead >= 0xC2 && lead <= 0xDF ? 2
                        : lead >= 0xE0 && lead <= 0xEF ? 3
                        : lead >= 0xF0 && lead <= 0xF4 ? 4
                                                       : 0;
  if (n > text.size()) return 0;
  const auto follows = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; };
  return std::all_of(text.begin() + 1,
                     text.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(n, 1)), follows)
             ? n
             : 0;
}

}  // namespace

/// Parts come from files, which may hold anything: what a terminal cannot show becomes a question mark.
std::string Error::line() const {
  std::string all = where.empty() ? what : where + ": " + what;
  if (!fix.empty()) all += "; " + fix;
  std::string out;
  for (std::string_view rest = all; !rest.empty();) {
    const std::size_t n = character_bytes(rest);
    const auto first = static_cast<unsigned char>(rest[0]);
    const bool control_of_two = first == 0xC2 && n == 2 && static_cast<unsigned char>(rest[1]) < 0xA0;
    if (first == '\n' || first == '\r' || first == '\t')
      out += ' ';
    else if (n == 0 || first < 0x20 || first == 0x7F || control_of_two)
      out += '?';
    else
      out += rest.substr(0, n);
    rest.remove_prefix(std::max<std::size_t>(n, 1));
  }
  return out;
}

void check_failed(const char* expression, const char* file, int line) {
  throw std::logic_error(text("evpose: internal check failed: ", expression, " (", file, ":", line, ")"));
}

}  // namespace evpose
