// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose::experiments {

/// Flights that nobody has looked at.
struct UnseenRequest {
  int seeds = 10, from = 0;
  double minutes = 0;  ///< after them no seed is begun; 0: all seeds
  std::string output = "unseen";
  std::string flights;  ///< folder in which flights are kept and found again; empty: they are deleted
  std::string known;    ///< results.jsonl of another run, whose seeds are not flown again; empty: none
  std::string compare;  ///< likewise, to compare with; empty: none
  bool quick = false, rebuild_maps = false;
  int threads = 1;                       ///< seeds at a time
  std::vector<std::string> assignments;  ///< settings of the tracker, "key=value"
};

/// Makes and tracks the flights of the seeds and writes to the output folder: README.md (the page),
/// results.jsonl (a line a seed), seeds/ (pictures, and what a later run goes on from). The result does not
/// depend on the number of threads nor on how often it was interrupted. Prints a line a seed, the summary and
/// the comparison.
Status run_unseen(const UnseenRequest& request);

}  // namespace evpose::experiments
