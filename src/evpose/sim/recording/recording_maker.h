// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>

#include "evpose/core/error.h"
#include "evpose/sim/recording/scenario.h"

namespace evpose::sim {

/// Statistics of a recording.
struct RecordingCounts {
  double duration_s = 0;
  ReadOut::Counts read_out;
  std::array<std::int64_t, 4> by_cause{};   ///< delivered events by EventCause
  std::array<std::int64_t, 3> by_origin{};  ///< delivered signal events by EventOrigin
  PixelIntegratorCounts integrator;
  int frames = 0;
  std::size_t contour_points = 0;
};

/// Makes the recording of a scenario in `folder`: events.h5, imu.csv, groundtruth.tum and
/// groundtruth_camera.tum (exact), camchain-imucam.yaml, imu.yaml, contours.ply (true), mesh.ply (static
/// scene), scenario.yaml (every setting), and, where the scenario enables them, frames/, depth/, map_raw.ply,
/// events_truth.h5, and camchain-imucam_truth.yaml and handed_over.yaml beside a calibration with errors. The
/// folder appears when it is complete; the result of an earlier run is replaced. The same scenario gives the
/// same bytes, for any number of threads, and whether its world is in the folder `world_cache` (WorldCache)
/// or not. `progress` is called with the completed fraction. Errors: what is wrong with the scenario; a
/// folder that cannot be written.
Expected<RecordingCounts> make_recording(const Scenario& scenario, const std::string& folder, int threads,
                                         const std::function<void(double fraction)>& progress,
                                         const std::string& world_cache = {});

}  // namespace evpose::sim
