// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>

#include "evpose/camera/calibration_sigma.h"

namespace evpose {
class ConfigTable;
struct CalibratedCamera;
}  // namespace evpose

namespace evpose::sim {

enum class CalibrationQuality : std::uint8_t {
  truth,     ///< no errors
  ordinary,  ///< what an ordinary calibration of camera and IMU leaves
};

/// Errors of the calibration that is handed over, 1 sigma each. -1 is replaced by the value of the preset.
struct HandedOverConfig {
  CalibrationQuality preset = CalibrationQuality::truth;
  double focal_sigma = -1;      ///< relative, of both focal lengths together
  double centre_sigma_px = -1;  ///< of each coordinate of the principal point
  double k1_sigma = -1, k2_sigma = -1, p1_sigma = -1, p2_sigma = -1;  ///< lens distortion
  double rotation_sigma_deg = -1;    ///< between camera and IMU, about each axis
  double translation_sigma_mm = -1;  ///< of the camera from the IMU, along each axis
  double time_sigma_ms = -1;         ///< of the camera's time towards the IMU's
};
void describe(ConfigTable& table, HandedOverConfig& config);
HandedOverConfig with_preset_values(const HandedOverConfig& config);

/// Errors of one calibration: handed over = truth + error. Drawn independently of each other, though a
/// calibration's are correlated (focal length and distortion).
struct CalibrationErrors {
  double focal = 0;  ///< relative
  std::array<double, 2> centre_px{};
  std::array<double, 4> distortion{};                       ///< k1, k2, p1, p2
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();   ///< rotation vector in the camera's frame
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();  ///< in the IMU's frame
  double time_s = 0;
  bool none() const;
};
CalibrationErrors draw_calibration_errors(const HandedOverConfig& config, std::uint64_t seed);

/// What a file states that holds a drawn calibration of this camera.
CalibrationSigma stated_sigma(const HandedOverConfig& config, const CameraIntrinsics& camera);

/// A radial-tangential camera with T_cam_imu.
CalibratedCamera with_errors(const CalibratedCamera& truth, const CalibrationErrors& errors);
/// As YAML, in the units of the config.
std::string to_yaml(const CalibrationErrors& errors);

}  // namespace evpose::sim
