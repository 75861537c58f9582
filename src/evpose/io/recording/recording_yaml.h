// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "evpose/io/recording/recording.h"

namespace evpose {

/// recording.yaml as read: the overrides, nothing opened. File names are relative to the folder.
struct RecordingOverrides {
  std::string name;
  std::optional<std::string> events, imu, groundtruth, calibration, imu_model, contours, map, frames;
  std::string events_format, imu_topic;
  int camera_index = -1;           ///< -1: the first that sees events, else the first
  bool states_imu_layout = false;  ///< columns or time unit of imu.csv
  bool states_gyro_unit = false, states_accel_unit = false;  ///< then they are taken at their word
  EventReadOptions event_options;
  ImuReadOptions imu_options;
  FrameReadOptions frame_options;
  FrameCamera frame_camera;
  std::optional<double> offset_events_s, offset_groundtruth_s, t_start_s, t_end_s;
  std::string groundtruth_body = "imu";  ///< imu, camera or marker
  std::optional<Pose> T_body_imu, T_map_world;
  std::string world_frame, map_frame;
  std::optional<Eigen::Matrix4d> T_ned_map;
  std::optional<InitialPose> initial_pose;
};

/// Errors: file and line of what is wrong; an unknown key names the nearest known one.
Expected<RecordingOverrides> read_recording_yaml(const std::string& path);

}  // namespace evpose
