// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "evpose/core/pose.h"
#include "evpose/report/run_folder.h"
#include "evpose/report/series.h"
#include "evpose/report/state_log.h"

namespace evpose {

using PageJson = nlohmann::ordered_json;

inline constexpr std::size_t kSeriesPoints = 1000, kBandPoints = 300;

/// Thinned out to about so many points, with every peak.
PageJson series_json(const Series& series, std::size_t points = kSeriesPoints);

/// Velocity in the map with its band of 3 sigma, and attitude, with that of the truth as far as it is known.
PageJson motion_json(const StateLog& log, std::span<const TimedPose> truth, TimeNs origin);
/// Of gyroscope and accelerometer; null if none was estimated.
PageJson biases_json(const StateLog& log, TimeNs origin);
/// Rows of a table: how the run was started, the first pose, and when it was tracked.
PageJson start_json(const StateLog& log, const RunSummary& summary);
/// Table of what was given and found, and the course of each number; null if none was estimated.
PageJson calibration_page_json(const StateLog& log, const RunSummary& summary, TimeNs origin);

/// Each number with the sigma that it was given with and has in the end, as in summary.json.
PageJson calibration_json(const RunCalibration& calibration);

}  // namespace evpose
