// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"

namespace evpose {

/// What `evpose check` tells, a line for each thing that stands between data and a pose, printed at once.
class Checklist {
 public:
  void ok(const std::string& thing, const std::string& words);
  /// Worth knowing, but nothing to mend before tracking.
  void note(const std::string& thing, const std::string& words);
  void problem(const std::string& thing, const Error& error);
  /// Could not be looked at for a problem above.
  void skipped(const std::string& thing);

  int problems() const { return problems_; }

 private:
  int problems_ = 0;
};

}  // namespace evpose
