// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// One camera of Kalibr's camchain-imucam.yaml.
struct KalibrCamera {
  CameraIntrinsics intrinsics;
  bool has_extrinsics = false;
  Pose T_cam_body;                 ///< Kalibr's T_cam_imu; identity without extrinsics
  double timeshift_cam_imu_s = 0;  ///< t_imu = t_cam + timeshift
};

/// Reads cam`index`; its T_cam_imu, or the chain of T_cn_cnm1 down to a camera that has one. Errors name the
/// line: broken YAML, missing keys, a model that is not pinhole with radtan, equidistant or none, a transform
/// that is not rigid to 1e-3.
Expected<KalibrCamera> read_kalibr_camera(const std::string& path, int index = 0);
/// As cam0. Without extrinsics neither T_cam_imu nor the shift is written.
Status write_kalibr_camera(const std::string& path, const KalibrCamera& camera);

/// Kalibr's imu.yaml, plain or nested under imu0. Errors name the line: missing or non-positive values, a
/// model with scale and misalignment.
Expected<ImuNoise> read_kalibr_imu(const std::string& path);
Status write_kalibr_imu(const std::string& path, const ImuNoise& noise);

}  // namespace evpose
