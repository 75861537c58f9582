// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "evpose/camera/camera.h"

namespace evpose {

/// An offset at a place of the image, px.
struct FieldArrow {
  Eigen::Vector2d pixel, offset_px;
};

/// Events beside their contours, in a ring of the image.
struct RadiusBin {
  double radius_px = 0;
  double outward_px = 0;  ///< mean offset away from the middle
  double rms_px = 0;      ///< of the offsets across their contours
  int contours = 0;
};

/// One number of a calibration.
struct CalibrationNumber {
  std::string name, unit;
  double given = 0, given_sigma = 0, found = 0, sigma = 0;
};

/// How the camera was moved in one recording.
struct FlightMotion {
  std::string name;
  double duration_s = 0;
  double accepted = 0;                                   ///< share of the updates
  Eigen::Vector3d rate_deg_s = Eigen::Vector3d::Zero();  ///< RMS about the body's axes
  double speed_m_s = 0, acceleration_m_s2 = 0;           ///< RMS
  double coverage = 0;                                   ///< share of the image in which contours were seen
};

/// All that the page of a calibration is made of.
struct CalibrationPage {
  std::string title, subtitle;
  ImageSize size;
  std::vector<CalibrationNumber> numbers;
  std::vector<CalibrationNumber> imu_axes;  ///< scale and misalignment; empty: no IMU
  Eigen::MatrixXd correlation;              ///< of the numbers; empty: not known
  std::vector<std::string> words;           ///< what was told and what was not
  std::vector<FieldArrow> before;           ///< by which the given calibration sees things elsewhere
  std::vector<FieldArrow> after;            ///< of events from contours, with the found one
  std::vector<RadiusBin> radius;            ///< likewise
  std::vector<FlightMotion> flights;
};

/// The report of a calibration: one HTML file that needs nothing else.
std::string calibration_page(const CalibrationPage& page);

}  // namespace evpose
