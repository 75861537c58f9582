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
  bool two_cores = false;  ///< decoding beside tracking, by the wall clock; else processor time of one thread
  double burst_mev_s = 0;  ///< of random events, for 50 ms in the middle
  bool beside_batch = false;  ///< and once more with events associated at the update
  int runs = 1;               ///< of each; the median of every figure is told
};

/// Tracks recordings in packets of a millisecond, as words of EVT3 and with events at random pixels added
/// until they come at the rates asked for, and prints a row for each: what that takes from words to pose, how
/// long the pose takes from its newest event, and how good it is.
Status print_realtime(const RealtimeRequest& request);

}  // namespace evpose::experiments
