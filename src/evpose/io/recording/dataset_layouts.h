// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/io/calibration/calibration.h"
#include "evpose/io/recording/recording_yaml.h"

namespace evpose {

/// What a folder or file turned out to hold: names for a Recording, and what could not be found.
struct FoundRecording {
  std::string folder;  ///< the names below are relative to it; they may lead out of it by ../
  std::string layout;  ///< "recording folder", "TUM-VIE sequence", "VECtor sequence", ...
  RecordingOverrides files;
  std::optional<CalibratedCamera> camera;  ///< put together from several files; unset: files.calibration
  std::optional<ImuNoise> imu_noise;
  std::vector<std::string> calibration_files;  ///< those that camera and noise come from
  std::vector<Error> missing;                  ///< what is not there, and where to put it
};

/// Looks at names, and into calibrations and the first lines of text files; events are not opened. Knows our
/// recording folder, TUM-VIE, VECtor and DSEC sequences as downloaded, bags and other files that hold events
/// and IMU together, and folders whose files tell by themselves what they are. Calibrations are looked for in
/// the folder and below it, those of TUM-VIE, VECtor and DSEC also beside it. Errors: no such file, nothing
/// with events, a calibration that cannot be read.
Expected<FoundRecording> find_recording(const std::string& path);

}  // namespace evpose
