// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"
#include "evpose/report/run_folder.h"
#include "evpose/tracker/update.h"

namespace evpose {

/// An update as a run folder tells it.
struct RunRow {
  TimeNs t = 0;
  Pose T_map_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    ///< map frame, m/s
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< m/s^2
  Matrix6d covariance = Matrix6d::Zero();  ///< translation in the map, rotation in the body; m, rad
  Health health = Health::waiting;
  std::string reason;
  int events_read = 0, points = 0, points_matched = 0;

  /// The tracker stands by the pose.
  bool valid() const { return has_pose(health); }
  double position_sigma_m() const;    ///< in the weakest direction
  double rotation_sigma_deg() const;  ///< about the weakest axis
};

/// A run folder, read.
struct RunFiles {
  std::string folder;
  RunInput input;
  bool interrupted = false;  ///< before the recording's end
  std::string calibration;   ///< the file to look with: what the run found, else what it was given
  std::vector<RunRow> rows;
};

/// Whether a folder is what `evpose track -o` leaves.
bool is_run_folder(const std::string& path);

/// Errors: no run folder; files that are not as evpose writes them, with the line.
Expected<RunFiles> read_run_files(const std::string& folder);

}  // namespace evpose
