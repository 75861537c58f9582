// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/map_learn/trajectory.h"
#include "evpose/run/track_recording.h"

namespace evpose::map_learn {

/// Of each contrast segment of `job.map`: by how much its visible samples moved across it in the image, px,
/// summed over samples and time. As many pixels were passed by the contour and would have told events.
std::vector<double> swept_pixels(const TrackJob& job, const Trajectory& trajectory);

/// Which segments swept enough pixels to be sure of their events and told hardly any. `events`: of each, how
/// many lay on it. What is usual is the median of those that told some.
std::vector<bool> silent_segments(const std::vector<double>& swept_px, const std::vector<double>& events);

}  // namespace evpose::map_learn
