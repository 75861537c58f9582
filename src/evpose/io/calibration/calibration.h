// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/camera/calibration_sigma.h"
#include "evpose/camera/camera.h"
#include "evpose/camera/trail_filter.h"
#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// One camera of a calibration file, in Kalibr's conventions whatever the file's own are.
struct CalibratedCamera {
  std::string name;  ///< the file's own word, else cam0, cam1, ...
  std::string sees;  ///< "event", "frame", or "" where the file does not say
  /// Unset: the file knows only where the camera sits. distortion_model may name a model that make_camera()
  /// refuses; `distortion` then holds all numbers that are no focal length or principal point.
  std::optional<CameraIntrinsics> intrinsics;
  std::optional<Pose> T_cam_imu;
  std::optional<Pose> T_cam_cam0;        ///< from the file's first camera
  bool has_timeshift = false;            ///< the file says something about it
  double timeshift_cam_imu_s = 0;        ///< t_imu = t_cam + timeshift
  CalibrationSigma sigma;                ///< as far as the file states it
  TrailFilterSetting trail_filter;       ///< of the sensor, likewise
  int model_line = 1, numbers_line = 1;  ///< where model and intrinsics stand in the file
};

/// A transform of which the file says only the name.
struct NamedTransform {
  std::string name;
  Pose pose;
};

struct CalibrationFile {
  std::string path;
  std::string kind;  ///< "Kalibr camera chain", "Basalt", "ROS camera_info", ...
  std::vector<CalibratedCamera> cameras;
  std::optional<ImuNoise> imu_noise;
  std::vector<NamedTransform> transforms;
  std::vector<Error> notes;  ///< what looks wrong but may be meant, and what was not taken
};

/// Reads what calibration tools and data sets write: Kalibr (camchain, camchain-imucam, imu; OpenVINS's
/// variants), Basalt, ROS camera_info (VECtor, ESVO2), OpenCV YAML (VINS, Canny-EVT, ORB-SLAM3), DSEC,
/// ncamera, EuRoC's sensor.yaml, and calib.txt. Errors name file and line: broken YAML, a kind that is not
/// known, missing keys, wrong counts, a transform that is not rigid to 1e-3.
Expected<CalibrationFile> read_calibration(const std::string& path);

/// The camera of the number, or with -1 the first that sees events, else the first. Errors: no such camera;
/// no intrinsics; a model that is not implemented or makes no camera, by name and line.
Expected<CalibratedCamera> choose_camera(const CalibrationFile& file, int index = -1);

}  // namespace evpose
