// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/calibration/kalibr.h"

#include <array>
#include <charconv>
#include <cmath>

#include "evpose/io/files/atomic_file.h"

namespace evpose {
namespace {

std::string exact(double value) {
  std::array<char, 40> buffer{};
  return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
}

std::string list(const std::vector<double>& values) {
  std::string out = "[";
  for (std::size_t i = 0; i < values.size(); ++i) out += (i == 0 ? "" : ", ") + exact(values[i]);
  return out + "]";
}

std::string matrix(const std::string& key, const Eigen::Matrix3d& M) {
  std::string out = "  " + key + ":\n";
  for (int r = 0; r < 3; ++r) out += "  - " + list({M(r, 0), M(r, 1), M(r, 2)}) + "\n";
  return out;
}

/// Nothing where they are not stated.
std::string sigmas(const Eigen::Matrix3d& sigma) {
  return sigma.minCoeff() < 0 ? "" : matrix("M_sigma", sigma);
}

}  // namespace

Status write_kalibr_camera(const std::string& path, const CalibratedCamera& camera) {
  EVPOSE_CHECK(camera.intrinsics.has_value());
  const CameraIntrinsics& c = *camera.intrinsics;
  const bool sphere = c.distortion_model == "ds";  // a camera model of its own there
  std::vector<double> numbers = {c.fx, c.fy, c.cx, c.cy};
  if (sphere) numbers.insert(numbers.begin(), c.distortion.begin(), c.distortion.end());
  std::string out = text("cam0:\n  camera_model: ", sphere ? "ds" : "pinhole", "\n");
  out += "  distortion_coeffs: " + list(sphere ? std::vector<double>{} : c.distortion) + "\n";
  out += "  distortion_model: " + (sphere ? "none" : c.distortion_model) + "\n";
  out += "  intrinsics: " + list(numbers) + "\n";
  out += text("  resolution: [", c.size.width, ", ", c.size.height, "]\n");
  if (camera.T_cam_imu) {
    const Eigen::Matrix4d T = camera.T_cam_imu->matrix();
    out += "  T_cam_imu:\n";
    for (int r = 0; r < 4; ++r) out += "  - " + list({T(r, 0), T(r, 1), T(r, 2), T(r, 3)}) + "\n";
    out += "  timeshift_cam_imu: " + exact(camera.timeshift_cam_imu_s) + "\n";
  }
  const CalibrationSigma& sigma = camera.sigma;
  if (sigma.intrinsics) out += "  intrinsics_sigma: " + list(*sigma.intrinsics) + "\n";
  if (sigma.distortion) out += "  distortion_sigma: " + list(*sigma.distortion) + "\n";
  if (sigma.rotation_rad && sigma.translation_m) {
    const Eigen::Vector3d turn = *sigma.rotation_rad * (180 / M_PI), &shift = *sigma.translation_m;
    out +=
        "  T_cam_imu_sigma: " + list({turn.x(), turn.y(), turn.z(), shift.x(), shift.y(), shift.z()}) + "\n";
  }
  if (sigma.time_s) out += "  timeshift_sigma: " + exact(*sigma.time_s) + "\n";
  if (sigma.correlation) {
    out += "  calibration_correlation:\n";
    for (const auto& row : sigma.correlation->rowwise())
      out += "  - " + list({row.begin(), row.end()}) + "\n";
  }
  if (const TrailFilterSetting& filter = camera.trail_filter; filter.kind != TrailFilterKind::none)
    out += text("  trail_filter: ", trail_filter_word(filter.kind),
                "\n  trail_filter_gap: ", exact(filter.longest_gap_s), "\n");
  return write_text_file(path, out);
}

Expected<ImuNoise> read_imu_noise(const std::string& path) {
  const auto file = read_calibration(path);
  if (!file) return file.error();
  if (!file->imu_noise)
    return Error{path, text("a file of the kind '", file->kind, "' holds no IMU noise"),
                 "give imu.yaml as Kalibr writes it"};
  return *file->imu_noise;
}

Status write_kalibr_imu(const std::string& path, const ImuNoise& noise) {
  std::string out = "accelerometer_noise_density: " + exact(noise.accel_density) +
                    "\naccelerometer_random_walk: " + exact(noise.accel_walk) +
                    "\ngyroscope_noise_density: " + exact(noise.gyro_density) +
                    "\ngyroscope_random_walk: " + exact(noise.gyro_walk) +
                    "\nupdate_rate: " + exact(noise.rate_hz) + "\n";
  const ImuAxes& axes = noise.axes;
  const Eigen::Matrix3d none = Eigen::Matrix3d::Identity();
  if (!axes.are_ideal())
    out += "model: scale-misalignment\naccelerometers:\n" + matrix("M", axes.accel) +
           sigmas(axes.accel_sigma) + "gyroscopes:\n" + matrix("M", axes.gyro) + sigmas(axes.gyro_sigma) +
           matrix("A", axes.gyro_by_force) + matrix("C_gyro_i", none);
  return write_text_file(path, out);
}

}  // namespace evpose
