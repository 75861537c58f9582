// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/time.h"
#include "evpose/fusion/back_end.h"

namespace evpose {

/// What was known of the calibration at an instant, in the order of calibration_columns().
struct CalibrationRow {
  TimeNs t = 0;
  std::vector<double> value;  ///< to be added to what was given
  std::vector<double> sigma;
};

/// Name and unit of each number: time offset, turn and shift of the camera, tilt of gravity, and the
/// camera's `intrinsics` numbers, if they are states.
std::vector<std::string> calibration_columns(std::size_t intrinsics);
CalibrationRow calibration_row(TimeNs t, const Calibration& calibration);
/// Whether any of it is a state.
bool is_estimated(const CalibrationRow& row);

/// Columns and rows of calibration.csv.
std::string calibration_csv_header(const CalibrationRow& first);
std::string calibration_csv_row(const CalibrationRow& row);

/// Seconds with all nine decimals.
std::string csv_seconds(TimeNs t);
/// A comma and nine digits.
void append_csv(std::string& row, double value);

}  // namespace evpose
