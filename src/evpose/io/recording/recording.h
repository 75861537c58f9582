// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evpose/camera/calibration_sigma.h"
#include "evpose/camera/camera.h"
#include "evpose/camera/trail_filter.h"
#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/imu/imu.h"
#include "evpose/io/events/event_reader.h"
#include "evpose/io/motion/imu_csv.h"
#include "evpose/io/recording/frame_reader.h"

namespace evpose {

/// Where the body is at the start, from recording.yaml.
struct InitialPose {
  TimeNs t = 0;
  Pose T_map_body;
  double sigma_p_m = 0.05;  ///< 1 sigma for each axis
  double sigma_q_deg = 1;   ///< 1 sigma for each axis
};

/// A recording folder (formats 1), opened: its small files read and checked, its streams known to fit
/// together.
struct Recording {
  std::string folder, name;
  std::string layout;          ///< what it was recognised as: "recording folder", "TUM-VIE sequence", ...
  std::vector<Error> missing;  ///< what could not be found, and where to put it; it works without

  CameraIntrinsics camera;
  CalibrationSigma calibration_sigma;  ///< of camera, T_cam_body and the IMU's time
  TrailFilterSetting trail_filter;     ///< of the sensor, as the calibration states it
  double timeshift_cam_imu_s = 0;      ///< t_imu = t_cam + timeshift; the events' times already have it
  Pose T_cam_body;  ///< identity when there is no IMU and the calibration has no extrinsics: body = camera
  bool has_imu = false;
  ImuNoise imu_noise;

  std::string events_path;         ///< empty: frames alone
  std::string calibration_path;    ///< the first where a calibration has several files
  std::string frames_path;         ///< list of frames through the event camera's pixels; empty: none
  FrameReadOptions frame_options;  ///< offset, crop and size filled in
  FrameCamera frame_camera;
  std::string imu_path, imu_model_path;                   ///< empty without IMU
  std::string groundtruth_path, contours_path, map_path;  ///< empty: none
  std::string events_format;                              ///< of event_formats.h; empty: found by content
  EventReadOptions event_options;                         ///< offset, crop, flips and size filled in
  ImuReadOptions imu_options;
  std::shared_ptr<const std::vector<ImuSample>> imu_samples;  ///< set where a file holds more than the IMU

  TimeNs first_ns = 0,
         last_ns = 0;  ///< common span of events (or frames) and IMU, inside the crop, on the IMU's clock
  std::int64_t event_count = -1;  ///< of the whole file; -1: not known
  std::optional<Error>
      clocks_apart;  ///< events and IMU have no time in common; see open_unjoined_recording()

  TimeNs groundtruth_offset_ns = 0;
  std::optional<Pose>
      T_stored_body;  ///< stored body of the ground truth from the IMU; unset: they are the same
  Pose T_map_world;   ///< world of the ground truth to map
  std::optional<Eigen::Matrix4d> T_ned_map;
  std::optional<InitialPose> initial_pose;
};

/// Opens a recording folder, a sequence of TUM-VIE, VECtor or DSEC as downloaded, or a file that holds events
/// (find_recording() in dataset_layouts.h tells them apart): reads recording.yaml, if there is one,
/// calibration and IMU model, and checks that events and IMU exist, have plausible units and overlap. The IMU
/// is read through once, the events are not. `calibration`: a file to use instead of the one found. Errors
/// name the file and line.
Expected<Recording> open_recording(const std::string& path, const std::string& calibration = "");

/// The same where events and IMU may have no time in common: clocks_apart says so then, and first_ns and
/// last_ns are of the events alone.
Expected<Recording> open_unjoined_recording(const std::string& path, const std::string& calibration = "");

/// Error: it has frames alone.
Expected<std::unique_ptr<EventReader>> open_events(const Recording& recording, double packet_s = 1e-3);

/// A fault of ours without frames.
Expected<FrameReader> open_frames(const Recording& recording);

/// A fault of ours without IMU.
Expected<ImuReader> open_imu(const Recording& recording);

/// T_map_body on the IMU's clock; not cropped. Errors: there is none; those of read_tum().
Expected<std::vector<TimedPose>> read_groundtruth(const Recording& recording);

}  // namespace evpose
