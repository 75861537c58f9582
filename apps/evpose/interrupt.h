// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace evpose {

/// While it lives, Ctrl-C and a polite kill are remembered instead of ending the program, so that no half
/// file is left behind. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  static bool interrupted();
};

/// Exit status of a program that was interrupted and has cleaned up.
inline constexpr int kInterruptedStatus = 130;

}  // namespace evpose
