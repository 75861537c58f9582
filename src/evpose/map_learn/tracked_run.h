// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/fusion/back_end.h"
#include "evpose/map_learn/trajectory.h"
#include "evpose/report/run_files.h"
#include "evpose/run/track_recording.h"

namespace evpose::map_learn {

constexpr double kLeastTracked = 0.5;  ///< share of a flight's time, if it is of this map

/// A run folder as the beginning of learning. Errors: no run folder; made from another recording or map than
/// these files; broken off, lost at its end, or tracked in less than kLeastTracked of its time.
Expected<RunFiles> read_run_of(const std::string& folder, const std::string& recording,
                               const std::string& map);

/// Share of the run in which it was tracking.
double tracking_share(const RunFiles& run);

/// From the first pose that the run stands by to its last, at the times at which a tracker that starts there
/// makes its updates. The covariance is that of the pose alone.
Trajectory states_of(const RunFiles& run, double rate_hz);

/// What the run has found to be wrong with the job's calibration; nothing, if it did not look.
Expected<Calibration> found_by(const RunFiles& run, const TrackJob& job);

/// The request whose start is that of the trajectory, and whose calibration, if it names none, is that which
/// the run was given.
TrackRequest request_of(TrackRequest request, const RunFiles& run, const FusionState& start);

}  // namespace evpose::map_learn
