// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <string>

namespace evpose {

/// As printf(), up to 511 characters.
std::string formatted(const char* pattern, auto... values) {
  char buffer[512];
  std::snprintf(buffer, sizeof buffer, pattern, values...);
  return buffer;
}

/// Text inside of an HTML element or attribute.
std::string escaped_html(const std::string& text);

}  // namespace evpose
