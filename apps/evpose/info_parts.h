// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/events/event_reader.h"
#include "evpose/io/recording/recording.h"
#include "sheet.h"

namespace evpose {

/// A span of time of one stream, to be compared with others.
struct Span {
  TimeNs first = 0, last = 0;
};

// Each describes one kind of thing on a sheet of its own section, with findings; what cannot be read to the
// end is described as far as it goes, and the rest is a finding. Errors are those that leave nothing to
// describe.

Expected<Span> describe_events(Sheet& sheet, const std::string& path, const std::string& format,
                               const EventReadOptions& options);
/// Streams beside the events of the same file: IMU, triggers, frames, poses.
Expected<std::optional<Span>> describe_sensors(Sheet& sheet, const std::string& path);
Span describe_imu(Sheet& sheet, const std::string& where, const std::vector<ImuSample>& samples);
/// Reads a text file of any layout first.
Expected<Span> describe_imu_file(Sheet& sheet, const std::string& path);
Span describe_trajectory(Sheet& sheet, const std::string& where, const std::vector<TimedPose>& poses,
                         const std::string& title = "trajectory");
Status describe_calibration(Sheet& sheet, const std::string& path);
void describe_camera(Sheet& sheet, const CalibratedCamera& camera, const std::string& key);
Status describe_map(Sheet& sheet, const std::string& path);
Status describe_recording(Sheet& sheet, const std::string& path);

/// Findings where two streams of one recording do not fit together.
void compare_spans(Sheet& sheet, const std::string& where, const Span& events, const Span& imu);

/// "24.000000 .. 24.224350 s"; with the date where it is Unix time.
std::string span_text(const Span& span);

}  // namespace evpose
