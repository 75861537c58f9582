// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"
#include "evpose/run/track_recording.h"

namespace evpose {

/// A camera that is known as a data sheet knows it, to within the few pixels that the tracker's alignment of
/// the start can bridge: over what the calibration's sigmas allow, that one with which the contours meet most
/// edges in slices of events of the first tenths of a second. A grid of focal lengths, principal points and
/// first radial terms at the start pose gives some, which are refined with all slices, at poses that the IMU
/// gives. Where the given sigmas are narrow, what was given is found, with these. `fusion`: resolved
/// settings. Error: those of the readers.
Expected<Calibration> coarse_camera(const TrackJob& job, const FusionConfig& fusion);

}  // namespace evpose
