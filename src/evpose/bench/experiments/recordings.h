// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/bench/experiments/streams.h"

namespace evpose::experiments {

/// What an experiment over a folder of recordings is told.
struct Selection {
  std::string folder = "../shared/data/peer";
  std::vector<std::string> only;         ///< names of recordings; empty: all
  std::vector<std::string> assignments;  ///< settings of the tracker, "key=value"
  std::string map;                       ///< for all of them; empty: their true contours and surfaces
};

/// A recording with ground truth, a map and a mesh that hides contours.
struct BenchRecording {
  std::string name, folder, map, occluders;
};

/// The shared recordings of a folder with `maps`, by name: the room's and the courtyard's. Of a folder
/// without, all recordings that `evpose simulate` has put there.
std::vector<BenchRecording> find_recordings(const std::string& folder);

/// Those of the selection. An Error where there is none.
Expected<std::vector<BenchRecording>> select_recordings(const Selection& selection);

/// The settings of a run with the assignments applied to the defaults.
Expected<RunConfig> configure(const std::vector<std::string>& assignments);

/// Reads a recording with its map into memory.
Expected<Streams> load_streams(const BenchRecording& recording, const RunConfig& config);

}  // namespace evpose::experiments
