// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

/// Tracks each recording with calibrations that are wrong by known amounts and prints what the tracker makes
/// of them: time offset, rotation and place of the camera.
Status print_calibration(const Selection& selection);

/// The accuracy of the pose with calibrations of ordinary errors: believed as given, and with their errors as
/// states of the filter. Start from the true pose of the body. After known errors one by one, `draws` sets of
/// all errors of an ordinary calibration together.
Status print_calibration_errors(const Selection& selection, int draws);

}  // namespace evpose::experiments
