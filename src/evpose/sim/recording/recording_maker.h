// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>

#include "evpose/core/error.h"
#include "evpose/sim/recording/scenario.h"

namespace evpose::sim {

/// What was made.
struct RecordingCounts {
  double duration_s = 0;
  ReadOut::Counts read_out;
  std::array<std::int64_t, 4> by_cause{};   ///< delivered events by EventCause
  std::array<std::int64_t, 3> by_origin{};  ///< delivered events that the signal made, by EventOrigin
  FilmCounts film;
  int frames = 0;
  std::size_t contour_points = 0;
};

/// Makes the recording of a scenario in `folder`: events.h5, imu.csv, groundtruth.tum and
/// groundtruth_camera.tum (exact), camchain-imucam.yaml, imu.yaml, contours.ply (true), mesh.ply (what stands
/// still), scenario.yaml (every setting), and what the scenario asks for of frames/, depth/, map_raw.ply and
/// events_truth.h5. The folder appears when all is written; one that an earlier run made is replaced. The
/// same scenario gives the same bytes, for any number of threads. `progress` is called with the share done.
/// Errors: what is wrong with the scenario; a folder that cannot be written.
Expected<RecordingCounts> make_recording(const Scenario& scenario, const std::string& folder, int threads,
                                         const std::function<void(double fraction)>& progress);

}  // namespace evpose::sim
