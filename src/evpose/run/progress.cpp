// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "evpose/core/log.h"

namespace evpose {

Progress::Progress(std::string what)
    : what_(std::move(what)),
      on_(isatty(STDERR_FILENO) != 0 && log_level() != LogLevel::quiet),
      start_(std::chrono::steady_clock::now()),
      last_(start_) {}

void Progress::at(double fraction) {
  if (!on_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < std::chrono::milliseconds(200)) return;
  last_ = now;
  shown_ = true;
  fraction = std::clamp(fraction, 1e-6, 1.0);
  const double spent_s = std::chrono::duration<double>(now - start_).count();
  std::fprintf(stderr, "\r%s %3.0f %%, %.0f s left ", what_.c_str(), 100 * fraction,
               spent_s * (1 - fraction) / fraction);
}

void Progress::done() {
  if (std::exchange(shown_, false)) std::fprintf(stderr, "\r%*s\r", static_cast<int>(what_.size()) + 30, "");
}

}  // namespace evpose
