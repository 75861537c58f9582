// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/camera/calibration_sigma.h"

namespace evpose {

/// What is known of a camera before it was ever calibrated, from data sheets and a ruler: what is stated,
/// with wide sigmas where nothing is. Square pixels; focal lengths 5 %, principal point 3 % of the width,
/// radial distortion 0.1; camera in the body 2 deg and 30 mm, time offset 10 ms.
CalibrationSigma data_sheet_sigma(const CalibrationSigma& stated, const CameraIntrinsics& camera);

/// The same for a camera that may have any ordinary lens: one without distortion, with angles in proportion
/// to the radius (equidistant), or between. Wanted where contours are seen in a small part of the image, so
/// that the rest of it is as uncertain as such lenses differ. Of the radial-tangential model alone.
CalibrationSigma any_lens_sigma(const CalibrationSigma& stated, const CameraIntrinsics& camera);

/// The same without what is stated, but for what is known.
CalibrationSigma only_data_sheet(const CalibrationSigma& stated, const CameraIntrinsics& camera);

/// A camera without a distortion model gets one, with zeros, so that one can be found.
CameraIntrinsics with_distortion(CameraIntrinsics camera);

}  // namespace evpose
