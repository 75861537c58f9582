// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

/// Tracks each recording with calibrations that are wrong by known amounts and prints what the tracker makes
/// of them: time offset, rotation and place of the camera.
Status print_calibration(const Selection& selection);

}  // namespace evpose::experiments
