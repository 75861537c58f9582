// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/camera_rig.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/config.h"

namespace evpose::sim {

CameraIntrinsics intrinsics(const CameraConfig& c) {
  // Slightly non-square pixels and an off-centre principal point, as in real calibrations.
  constexpr double kSquare = 1.0008, kRight_px = 2.9, kUp_px = 2.6;
  ImageSize size{c.width, c.height};
  double focal_px = c.focal_px;
  if (c.size == SensorSize::vga) {
    size = {640, 480};
    focal_px = 381;
  } else if (c.size == SensorSize::hd) {
    size = {1280, 720};
    focal_px = 763;
  } else if (c.size == SensorSize::davis) {
    size = {346, 260};
    focal_px = 206;
  }
  const double scale = size.width / 640.0;
  return {focal_px,
          focal_px * kSquare,
          0.5 * (size.width - 1) + kRight_px * scale,
          0.5 * (size.height - 1) - kUp_px * scale,
          "radtan",
          {c.k1, c.k2, c.p1, c.p2},
          size};
}

std::vector<float> lens_gain(const CameraConfig& config) {
  const CameraIntrinsics c = intrinsics(config);
  double farthest = 0;
  for (const double x : {0.0, c.size.width - 1.0})
    for (const double y : {0.0, c.size.height - 1.0})
      farthest = std::max(farthest, std::hypot(x - c.cx, (y - c.cy) * c.fx / c.fy));
  // (1 + k r^2)^-2, with r = 1 in that corner.
  const double k = 1 / std::sqrt(1 - config.vignetting) - 1;
  std::vector<float> gain;
  gain.reserve(static_cast<std::size_t>(c.size.width) * c.size.height);
  for (int y = 0; y < c.size.height; ++y)
    for (int x = 0; x < c.size.width; ++x) {
      const double r = std::hypot(x - c.cx, (y - c.cy) * c.fx / c.fy) / farthest;
      gain.push_back(static_cast<float>(std::pow(1 + k * r * r, -2)));
    }
  return gain;
}

Pose T_body_cam(const CameraConfig& c) {
  constexpr double kDegree = std::numbers::pi / 180;
  Eigen::Matrix3d R_forward_cam;  // z forward, x right
  R_forward_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Eigen::Quaterniond turn = so3::exp(c.yaw_left_deg * kDegree * Eigen::Vector3d::UnitZ()) *
                                  so3::exp(c.pitch_down_deg * kDegree * Eigen::Vector3d::UnitY()) *
                                  so3::exp(c.roll_deg * kDegree * Eigen::Vector3d::UnitX());
  return {turn * Eigen::Quaterniond(R_forward_cam), {c.forward_m, c.left_m, c.up_m}};
}

void describe(ConfigTable& table, CameraConfig& c) {
  table.add("size", c.size,
            ConfigTable::Choices<SensorSize>{{"vga", SensorSize::vga},
                                             {"720p", SensorSize::hd},
                                             {"davis346", SensorSize::davis},
                                             {"custom", SensorSize::custom}},
            "640 x 480, 1280 x 720, 346 x 260, or as width, height and focal_px say");
  table.add("width", c.width, "px", "of a custom sensor", {16, 8192});
  table.add("height", c.height, "px", "of a custom sensor", {16, 8192});
  table.add("focal_px", c.focal_px, "px", "of a custom sensor", {10, 1e5});
  table.add("k1", c.k1, "", "radial distortion", {-1, 1});
  table.add("k2", c.k2, "", "radial distortion", {-1, 1});
  table.add("p1", c.p1, "", "tangential distortion", {-0.1, 0.1});
  table.add("p2", c.p2, "", "tangential distortion", {-0.1, 0.1});
  table.add("pitch_down_deg", c.pitch_down_deg, "deg", "of the optical axis, from straight ahead", {-90, 90});
  table.add("yaw_left_deg", c.yaw_left_deg, "deg", "of the optical axis, from straight ahead", {-180, 180});
  table.add("roll_deg", c.roll_deg, "deg", "about the optical axis", {-180, 180});
  table.add("vignetting", c.vignetting, "", "fraction of the light that the farthest corner lacks",
            {0, 0.95});
  table.add("blur_px", c.blur_px, "px", "1 sigma of the lens' point image along each axis; 0: sharp",
            {0, 0.7});
  table.add("forward_m", c.forward_m, "m", "of the lens from the IMU", {-10, 10});
  table.add("left_m", c.left_m, "m", "of the lens from the IMU", {-10, 10});
  table.add("up_m", c.up_m, "m", "of the lens from the IMU", {-10, 10});
}

}  // namespace evpose::sim
