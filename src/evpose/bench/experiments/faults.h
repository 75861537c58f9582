// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

struct FaultsRequest {
  Selection selection;
  int replays = 200, threads = 2;
  unsigned seed = 1;
  std::string fault;         ///< only this one, by name; empty: all
  std::vector<int> numbers;  ///< only these replays; empty: all
  bool each = false;         ///< a line for each replay
};

/// Replays stretches of the recordings with a fault in one stream each, seeded: what does the tracker say,
/// and is it ever wrong without saying so? The number of replays in which a pose was not finite.
Expected<int> print_faults(const FaultsRequest& request);

}  // namespace evpose::experiments
