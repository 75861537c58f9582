// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"
#include "evpose/imu/imu.h"
#include "evpose/io/calibration/calibration.h"

namespace evpose {

// Files as Kalibr writes them; read_calibration() reads them.

/// As cam0. Without T_cam_imu neither it nor the shift is written. A camera without intrinsics is a fault of
/// ours. What is known of the errors stands beside Kalibr's keys: intrinsics_sigma (px), distortion_sigma,
/// T_cam_imu_sigma (deg about, then m along each axis of the IMU), timeshift_sigma (s), and
/// calibration_correlation of all these in this order, row by row; so do the sensor's trail_filter (by its
/// word in kTrailFilters) and trail_filter_gap (s).
Status write_kalibr_camera(const std::string& path, const CalibratedCamera& camera);

/// The IMU's noise and axes of any calibration file that has them. Errors name the line: missing or
/// non-positive values, a model other than calibrated and scale-misalignment, axes far from ideal.
Expected<ImuNoise> read_imu_noise(const std::string& path);
/// With the model scale-misalignment unless the axes are ideal; their sigmas beside it as M_sigma. C_gyro_i
/// is in the gyroscope's M.
Status write_kalibr_imu(const std::string& path, const ImuNoise& noise);

}  // namespace evpose
