// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/config.h"
#include "evpose/core/error.h"
#include "evpose/report/run_folder.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Settings of a run: the tracker's and the driver's.
struct RunConfig {
  TrackerConfig tracker;
  double packet_ms = 1;  ///< events are read in packets of this length; the result does not depend on it
  int overlays = 8;      ///< pictures of the map over the time surface in the report
};
void describe(ConfigTable& table, RunConfig& config);

struct TrackRequest {
  std::string recording;                 ///< folder or file
  std::string calibration;               ///< file; empty: the one found with the recording
  std::string map;                       ///< file; empty: the recording's own
  std::string occluders;                 ///< mesh file; empty: those of the map, if any
  std::string init = "auto";             ///< see start.h
  std::string output;                    ///< run folder
  std::string config_file;               ///< optional YAML
  std::vector<std::string> assignments;  ///< "key=value"
};

/// Settings after the file and the assignments of the request.
Expected<RunConfig> load_config(const TrackRequest& request);

/// The main job: recording and map in, run folder out. Nothing is written on error.
Expected<RunOutcome> track_recording(const TrackRequest& request);

}  // namespace evpose
