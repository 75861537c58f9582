// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/core/config.h"
#include "evpose/core/error.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Settings of a run: the tracker's and the driver's.
struct RunConfig {
  TrackerConfig tracker;
  double packet_ms = 1;      ///< events are read in packets of this length; the result does not depend on it
  int overlays = 8;          ///< pictures of points over the time surface in the report
};
void describe(ConfigTable& table, RunConfig& config);

struct TrackRequest {
  std::string recording;                 ///< folder
  std::string map;                       ///< file; empty: the recording's own
  std::string init = "groundtruth";      ///< groundtruth, "x,y,z,qx,qy,qz,qw[@t_s]", or a TUM file
  std::string output;                    ///< run folder
  std::string config_file;               ///< optional YAML
  std::vector<std::string> assignments;  ///< "key=value"
};

struct TrackOutcome {
  Health final_health = Health::waiting;
  std::string summary;  ///< a few lines for people
  std::string report;   ///< path of report.html
};

/// The main job: recording and map in, run folder out. Nothing is written on error.
Expected<TrackOutcome> track_recording(const TrackRequest& request);

/// All settings with their defaults, a comment and a unit each.
Expected<std::string> dump_config(const TrackRequest& request);

}  // namespace evpose
