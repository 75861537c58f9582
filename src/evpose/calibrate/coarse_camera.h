// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"
#include "evpose/run/track_recording.h"

namespace evpose {

/// What the job is told of its calibration, with sigmas: no differences yet.
Calibration given_calibration(const TrackJob& job);

/// What a coarse search has found: the numbers, and how their errors go together (as
/// CalibrationSigma::correlation; empty: independent).
struct CoarseCamera {
  Calibration calibration;
  Eigen::MatrixXd correlation;
};

/// A camera that is known as a data sheet knows it, to within the few pixels that the tracker's alignment of
/// the start can bridge: over what the calibration's sigmas allow, that one with which the contours meet most
/// edges in slices of events of the first tenths of a second. A grid of focal lengths, principal points and
/// first radial terms gives some, which are refined; the slices' poses are those that the IMU gives. Where
/// the given sigmas are narrow, what was given is found, with these. `fusion`: resolved settings. Error:
/// those of the readers.
Expected<CoarseCamera> coarse_camera(const TrackJob& job, const FusionConfig& fusion);

/// The same once a trajectory is there: `found`, which the filter has come to, is compared over all of the
/// flight with cameras that differ in the radial terms, as far as the given sigmas allow. True: another one
/// is found, since contours meet clearly more edges with it.
Expected<bool> coarse_camera_along(const TrackJob& job, std::span<const FusionState> trajectory,
                                   CoarseCamera* found);

}  // namespace evpose
