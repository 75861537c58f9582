// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

struct RelocalizationRequest {
  Selection selection;
  int seeds = 20;                    ///< starts of each recording and class of errors
  std::vector<std::string> classes;  ///< how the names of the wanted ones begin; empty: all, and wrong maps
  int threads = 2;
  bool imu = true;
  double within_s = 0.5;  ///< of the start: so long it is watched
  std::string looks;      ///< file for what each update says of its pose (StartLooks); empty: none
};

/// Starts from wrong poses anywhere in the recordings: is the pose found, how soon, and is a wrong one ever
/// called tracking?
Status print_relocalization(const RelocalizationRequest& request);

}  // namespace evpose::experiments
