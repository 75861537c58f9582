// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/report/calibration_page.h"
#include "evpose/run/track_recording.h"

namespace evpose {

struct CalibrateRequest {
  std::vector<std::string> recordings;
  /// The rest of what is asked: map, calibration to begin with, start, settings. Its `output` is the camera
  /// chain to write; the report stands beside it.
  TrackRequest track;
};

struct CalibrateOutcome {
  CalibrationPage page;   ///< all that was found
  std::string report;     ///< path
  std::string imu_model;  ///< path; empty: no IMU
  bool converged = false;
};

/// Calibrates a camera, and where there is an IMU how it is mounted and its time offset and its axes, from
/// recordings before a known map: writes Kalibr's camera chain with sigmas and correlations, Kalibr's file of
/// the IMU, and a report. Nothing is
/// written on error; an interrupted run writes nothing, and the outcome is empty.
Expected<std::optional<CalibrateOutcome>> calibrate_recordings(const CalibrateRequest& request);

}  // namespace evpose
