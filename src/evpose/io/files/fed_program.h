// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// Another program, running, that is given data through its standard input. What it prints is not shown.
class FedProgram {
 public:
  /// `command`: the program's name, found as a shell finds it, and its arguments. Errors: it is not
  /// installed.
  static Expected<FedProgram> start(const std::vector<std::string>& command);
  FedProgram(FedProgram&& other) noexcept;
  FedProgram& operator=(FedProgram&&) = delete;
  /// Ends its input and waits for it, unless finish() has.
  ~FedProgram();

  /// Errors: it does not take any more.
  Status write(std::span<const std::byte> data);
  /// Ends its input and waits for it. Errors: its exit status is not 0.
  Status finish();

 private:
  FedProgram(std::string name, int input, int process)
      : name_(std::move(name)), input_(input), process_(process) {}
  int end();

  std::string name_;
  int input_ = -1, process_ = -1;
};

}  // namespace evpose
