// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/io/motion/imu_csv.h"

namespace evpose {

/// Finds out how to read a text file of IMU samples, one a line between blanks or commas: ours, EuRoC,
/// TUM-VIE (microseconds), VECtor (seconds), the event-camera data sets of 2017 (seconds, acceleration
/// first). The unit of time is told by the distance of the stamps, the order of rates and accelerations by
/// gravity; what follows them is ignored. Errors: fewer than seven columns, no two samples, no gravity in
/// either place.
Expected<ImuReadOptions> recognise_imu_text(const std::string& path);

}  // namespace evpose
