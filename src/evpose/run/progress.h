// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace evpose {

/// How long a job still takes, as far as that can be told: not in its first seconds, and never more than was
/// said before; nothing while it turns out to take much longer than that.
class RemainingTime {
 public:
  /// After `spent_s` seconds `fraction` (0..1) of it is done.
  std::optional<double> at(double fraction, double spent_s);

 private:
  std::optional<double> said_s_;
};

/// "tracking  43 %, 12 s left" on a terminal's stderr, redrawn a few times a second; silent elsewhere.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress() { done(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void at(double fraction);  ///< 0..1
  void done();               ///< clears the line

 private:
  std::string what_;
  bool shown_ = false, on_;
  double largest_ = 0;  ///< fraction shown
  RemainingTime remaining_;
  std::chrono::steady_clock::time_point start_, last_;
};

}  // namespace evpose
