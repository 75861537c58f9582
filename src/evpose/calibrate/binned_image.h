// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// The camera whose pixels are `binning` by `binning` of the given one's, >= 1; its angle of view is the
/// same.
CameraIntrinsics binned(CameraIntrinsics camera, int binning);

/// The events as that camera has them, in the same order.
std::vector<FilteredEvent> binned(std::span<const FilteredEvent> events, int binning);

}  // namespace evpose
