// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/imu/imu.h"
#include "evpose/io/events/event_reader.h"
#include "evpose/io/recording/recording.h"

namespace evpose {

/// What the events say of the gyroscope: where the camera turns fast, events that are turned back by the true
/// rate make a sharp picture. Told only where other axes would make a far sharper one than those that were
/// read: too little turning, or motion that is hardly turning, tells nothing. Reads events of the first
/// minute. Unset: no doubt. `R_cam_imu`: turns the IMU's axes into the camera's; `where` names the IMU.
/// Error: the reader's.
Expected<std::optional<Error>> doubt_gyro_by_events(EventReader& events, const Camera& camera,
                                                    const Eigen::Matrix3d& R_cam_imu,
                                                    const std::vector<ImuSample>& samples,
                                                    const std::string& where);
/// The same of a recording.
Expected<std::optional<Error>> doubt_gyro_by_events(const Recording& recording,
                                                    const std::vector<ImuSample>& samples);

}  // namespace evpose
