// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "evpose/core/error.h"
#include "evpose/core/log.h"

namespace evpose {
namespace {

constexpr double kFirst_s = 3;                     // of a job tell nothing about the rest
constexpr double kLeastFraction = 0.02;            // nor does less of it
constexpr double kMuchLonger = 1.5, kSlack_s = 2;  // than was said: then that was wrong

}  // namespace

std::optional<double> RemainingTime::at(double fraction, double spent_s) {
  if (spent_s < kFirst_s || fraction < kLeastFraction) return {};
  const double left_s = spent_s * (1 - fraction) / fraction;
  if (said_s_ && left_s > kMuchLonger * *said_s_ + kSlack_s) return {};
  said_s_ = std::min(left_s, said_s_.value_or(left_s));
  return said_s_;
}

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
  largest_ = std::max(largest_, std::clamp(fraction, 0.0, 1.0));
  const auto left_s = remaining_.at(largest_, std::chrono::duration<double>(now - start_).count());
  std::fprintf(stderr, "\r%s %3.0f %%%s", what_.c_str(), 100 * largest_,
               left_s ? text(", ", std::ceil(*left_s), " s left    ").c_str() : "               ");
}

void Progress::done() {
  if (std::exchange(shown_, false)) std::fprintf(stderr, "\r%*s\r", static_cast<int>(what_.size()) + 30, "");
}

}  // namespace evpose
