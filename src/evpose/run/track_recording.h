// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "evpose/core/config.h"
#include "evpose/core/error.h"
#include "evpose/io/recording/recording.h"
#include "evpose/report/run_folder.h"
#include "evpose/run/resources.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Settings of a run: the tracker's and the driver's.
struct RunConfig {
  TrackerConfig tracker;
  double packet_ms = 1;     ///< events are read in packets of this length; the result does not depend on it
  bool states_imu = false;  ///< states_imu.csv: the state at each IMU sample
  int overlays = 8;         ///< pictures of the map over the time surface in the report
};
void describe(ConfigTable& table, RunConfig& config);

struct TrackRequest {
  std::string recording;                 ///< folder or file
  std::string calibration;               ///< file; empty: the one found with the recording
  std::string imu_model;                 ///< file; empty: the recording's own, or the calibration's
  std::string map;                       ///< file; empty: the recording's own
  std::string occluders;                 ///< mesh file; empty: those of the map, if any
  std::string init = "auto";             ///< see start.h
  std::vector<double> init_sigma{0, 0};  ///< of a pose given there: m, deg
  std::string output;                    ///< run folder
  std::string preset;                    ///< a name of presets(); empty: the defaults
  std::string config_file;               ///< optional YAML
  std::string learnt_map;                ///< map.h5 to write, with the contrast learnt; empty: none
  std::vector<std::string> assignments;  ///< "key=value"
  bool replace = false;                  ///< an earlier run in the run folder
  std::function<bool()> interrupted;     ///< asked after each packet; true ends the run there
};

/// Settings after the file and the assignments of the request.
Expected<RunConfig> load_config(const TrackRequest& request);

/// All that a tracker wants to know before the first event.
struct TrackJob {
  RunConfig config;
  Recording recording;
  std::shared_ptr<const ContourMap> map;  ///< or the part around the start, if it is read by place
  std::vector<TimedPose> truth;           ///< empty: not known
  StartState start;
  std::string start_words;  ///< where it came from
  TrackerSetup setup;
  std::vector<Error> findings;  ///< what looks wrong although it can be tracked
};
/// Why a tracker that has seen all data has never compared a map point with them.
Error nothing_compared(const TrackJob& job, const Tracker& tracker);
/// Of the request's map, or the recording's own.
Expected<std::string> map_path(const TrackRequest& request, const Recording& recording);
/// All of that map.
Expected<std::shared_ptr<const ContourMap>> load_map(const TrackRequest& request, const Recording& recording);
/// The job on a recording that is known, with the map of the request or the recording's own.
Expected<TrackJob> make_job(const TrackRequest& request, const RunConfig& config, const Recording& recording,
                            std::vector<TimedPose> truth);
/// Reads and checks everything but the events.
Expected<TrackJob> prepare(const TrackRequest& request, const RunConfig& config);
/// Gives the tracker the streams of the recording, IMU and frames ahead so that no event has to wait for
/// them. `told`, if any, hears the share of the recording, 0..1, and ends it by false.
Status feed_recording(const Recording& recording, const RunConfig& config, Tracker& tracker,
                      const std::function<bool(double)>& told);
/// What was given of the calibration and is known of it in the end; none: it counted as known.
std::optional<RunCalibration> run_calibration(const TrackJob& job, const Calibration& found);
/// What the run folder is told at the end; without times and memory. `found`: of the calibration.
RunSummary summarise(const TrackJob& job, const TrackRequest& request, const Tracker& tracker,
                     const Calibration& found);

/// The main job: recording and map in, run folder out. Nothing is written on error. A run that is interrupted
/// is complete up to there.
Expected<RunOutcome> track_recording(const TrackRequest& request);

}  // namespace evpose
