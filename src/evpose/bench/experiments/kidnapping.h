// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

struct KidnappingRequest {
  Selection selection;
  int seeds = 20;    ///< places of each recording
  double cut_s = 1;  ///< data that are left out
  int threads = 2;
};

/// Live sessions whose data stop while the camera moves on: how soon are they back to tracking, and where?
Status print_kidnapping(const KidnappingRequest& request);

}  // namespace evpose::experiments
