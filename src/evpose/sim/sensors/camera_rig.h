// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"

namespace evpose {
class ConfigTable;
}

namespace evpose::sim {

enum class SensorSize : std::uint8_t {
  vga,     ///< 640 x 480
  hd,      ///< 1280 x 720, as of an EVK4
  davis,   ///< 346 x 260
  custom,  ///< as width, height and focal length say
};

/// Optics and mounting of the event camera.
struct CameraConfig {
  SensorSize size = SensorSize::vga;
  int width = 640, height = 480;  ///< of a custom sensor
  double focal_px = 381;          ///< of a custom sensor; the others see 80 degrees across
  double k1 = -0.1, k2 = 0.02, p1 = 5e-4, p2 = -3e-4;                ///< lens distortion, radial-tangential
  double pitch_down_deg = 1.2, yaw_left_deg = -0.8, roll_deg = 1.0;  ///< of the optical axis from +x
  double vignetting =
      0;               ///< light lost in the corner that is farthest from the principal point, as a fraction
  double blur_px = 0;  ///< 1 sigma of the point image
  double forward_m = 0.045, left_m = 0.025, up_m = -0.04;  ///< of the lens from the IMU
};
void describe(ConfigTable& table, CameraConfig& config);

CameraIntrinsics intrinsics(const CameraConfig& config);
Pose T_body_cam(const CameraConfig& config);
/// Fraction of the light that reaches each pixel, row by row: 1 at the principal point, and falling as the
/// fourth power of a cosine.
std::vector<float> lens_gain(const CameraConfig& config);

}  // namespace evpose::sim
