// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "evpose/core/config.h"
#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/eval/score.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/files/png_file.h"
#include "evpose/report/run_verdict.h"
#include "evpose/tracker/update.h"

namespace evpose {

struct Calibration;
struct FusionState;

/// A calibration that the tracker has estimated: as it was given, and as it was known at the end. Both state
/// their sigmas.
struct RunCalibration {
  CalibratedCamera given, found;
};

/// What a run was made from: absolute paths; empty: none of its own.
struct RunInput {
  std::string recording, map, calibration, occluders;
};

/// What a run folder is told at the end, beside the updates.
struct RunSummary {
  RunInput input;
  std::string title;                          ///< of the report, e.g. the recording's name
  std::string subtitle;                       ///< e.g. the map's name and how the run was started
  std::string start;                          ///< where the start pose came from: "started from ground truth"
  std::vector<Error> findings;                ///< what looked wrong with the input before the run
  bool interrupted = false;                   ///< before the recording's end
  Pose T_body_cam;                            ///< as known at the end
  std::optional<RunCalibration> calibration;  ///< if any of it was estimated
  std::vector<TimedPose> truth;               ///< T_map_body; empty where not known
  std::vector<Eigen::Vector3d> map_points;    ///< map frame, metres; drawn, thinned out
  std::uint64_t events_read = 0, events_kept = 0, events_shed = 0;
  std::vector<std::pair<int, int>> hot_pixels;  ///< x, y
  double wall_s = 0;                            ///< wall time of reading and tracking
  double cpu_s = 0;                             ///< processor time of the same, all threads
  double peak_memory_mb = 0;
  std::vector<std::pair<std::string, std::string>> versions;  ///< name, version; evpose's own is added
};

/// What came out, for the last lines on the terminal.
struct RunOutcome {
  std::optional<TrajectoryScore> score;  ///< if there is ground truth
  RunVerdict verdict;
  std::string text;    ///< five lines for people, and the verdict
  std::string report;  ///< path of report.html
};

/// The output of a run: trajectory.tum, trajectory_camera.tum, states.csv, if wanted states_imu.csv,
/// latency.csv, summary.json, config.yaml, report.html and, if it was estimated, calibration.yaml and
/// calibration.csv. It is made
/// under a temporary name beside its place and moved there when all is written, so that nothing is changed by
/// a run that fails. The same estimates give the same bytes, but for what depends on wall time: latency.csv,
/// report.html, and "latency", "resources" and "rate_mev_s" in summary.json.
class RunFolder {
 public:
  /// `replace`: an earlier run that stands there, once this one is finished. Errors: the place's parent does
  /// not exist or cannot be written; something stands there that is not an empty folder or, if it may be
  /// replaced, an earlier run.
  static Expected<RunFolder> create(const std::string& path, bool replace);
  RunFolder(RunFolder&&) noexcept;
  RunFolder& operator=(RunFolder&&) noexcept;
  /// Removes what was written unless finished.
  ~RunFolder();

  /// In order of time. Errors of writing are told by finish().
  void add(const Update& update);
  /// A state at an IMU sample, in order of time, for states_imu.csv; the file is made with the first.
  void add_state(const FusionState& state);
  /// What is known of the calibration after an update, in order of time, for calibration.csv: about twenty
  /// times a second, if any of it is estimated.
  void add_calibration(TimeNs t, const Calibration& calibration);
  /// A picture for the report.
  void add_overlay(const std::string& caption, const RgbImage& image);

  /// Writes the rest and puts the folder in its place. `config`: all that the run was set to. Once only.
  Expected<RunOutcome> finish(const RunSummary& summary, const ConfigTable& config);

 private:
  struct State;
  explicit RunFolder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace evpose
