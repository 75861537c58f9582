// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <string>

namespace evpose {

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
  std::chrono::steady_clock::time_point start_, last_;
};

}  // namespace evpose
