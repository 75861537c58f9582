// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"
#include "evpose/run/track_recording.h"

namespace evpose {

/// A camera that is known as a data sheet knows it, to within the few pixels that the tracker's alignment of
/// the start can bridge: of a grid of focal lengths, principal points and first radial terms over what the
/// calibration's sigmas allow, that one with which the contours meet most edges in a slice of events at the
/// start pose. What is found has the sigmas of the grid; where the given ones are narrow, what was given is
/// found, with these. Error: those of the reader.
Expected<Calibration> coarse_camera(const TrackJob& job);

}  // namespace evpose
