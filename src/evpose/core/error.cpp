// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/error.h"

namespace evpose {

std::string Error::line() const {
  std::string out = where.empty() ? what : where + ": " + what;
  if (!fix.empty()) out += "; " + fix;
  for (char& c : out)
    if (c == '\n' || c == '\r') c = ' ';
  return out;
}

void check_failed(const char* expression, const char* file, int line) {
  throw std::logic_error(text("evpose: internal check failed: ", expression, " (", file, ":", line, ")"));
}

}  // namespace evpose
