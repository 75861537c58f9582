// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

struct RealtimeRequest {
  Selection selection{
      .folder = "../shared/data/peer", .only = {"room_spiral", "room_720p"}, .assignments = {}, .map = {}};
  std::vector<double> rates_mev_s = {1, 5, 20, 50};  ///< of all events; below the recording's own: as it is
  std::vector<double> updates_hz = {300, 1000};
};

/// Tracks recordings in packets of a millisecond with events at random pixels added until they come at the
/// rates asked for, on one core, and prints a row for each: what that takes, how long the pose takes from its
/// newest event, and how good it is.
Status print_realtime(const RealtimeRequest& request);

}  // namespace evpose::experiments
