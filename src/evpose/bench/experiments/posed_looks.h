// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/bench/experiments/contour_looks.h"
#include "evpose/bench/experiments/streams.h"

namespace evpose::experiments {

/// The poses that the tracker finds, at the rate of the IMU.
Expected<std::vector<TimedPose>> tracked_poses(const Streams& streams);

/// Looks at the contours from where they are seen from these poses, at least two, map <- body; no gate.
std::vector<ContourLook> looks_from(const Streams& streams, const std::vector<TimedPose>& poses);

}  // namespace evpose::experiments
