// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/imu/imu.h"
#include "evpose/report/calibration_page.h"
#include "evpose/report/run_folder.h"

namespace evpose {

/// Names, units and values of all numbers, in the order of CalibrationSigma::correlation; without an IMU the
/// camera's alone.
std::vector<CalibrationNumber> numbers_of(const RunCalibration& calibration);
/// Elements of both axes, row by row, in percent (scale and misalignment alike); what was not stated of the
/// given ones is `sigma`.
std::vector<CalibrationNumber> axes_numbers(const ImuAxes& given, const ImuAxes& found, double sigma);

/// What the motion did not tell and which motion would, which numbers go together, and what remains wrong:
/// one sentence each.
std::vector<std::string> calibration_words(const CalibrationPage& page);

}  // namespace evpose
