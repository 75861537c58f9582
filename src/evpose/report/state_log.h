// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/report/calibration_log.h"
#include "evpose/tracker/update.h"

namespace evpose {

struct FusionState;

/// What a run folder remembers of an update until it is finished: about a quarter of a kilobyte.
struct StateRow {
  TimeNs t = 0;
  Pose T_map_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< map frame, m/s
  Eigen::Vector3f velocity_sigma = Eigen::Vector3f::Zero();
  Eigen::Vector3f gyro_bias = Eigen::Vector3f::Zero();   ///< rad/s
  Eigen::Vector3f accel_bias = Eigen::Vector3f::Zero();  ///< m/s^2
  std::array<float, 21> covariance{};                    ///< upper triangle by rows
  Health health = Health::waiting;
  std::int32_t events_read = 0, events_kept = 0, points = 0, points_matched = 0;
  std::array<float, 5> stages_ms{};  ///< in the order of kStageNames

  Matrix6d covariance_matrix() const;
  /// The tracker stands by the pose: one that it calls waiting or lost is not part of the trajectory.
  bool valid() const { return has_pose(health); }
};

inline constexpr std::array<const char*, 5> kStageNames{"choose", "events", "predict", "register", "fuse"};
inline constexpr std::size_t kStagesBeforeThePose = 2;  ///< they are done when the newest event comes

struct HealthChange {
  TimeNs t = 0;
  Health health = Health::waiting;
  std::string reason;
};

/// The updates of a run.
struct StateLog {
  std::vector<StateRow> rows;
  std::vector<HealthChange> health;         ///< the first state, and each change
  std::vector<CalibrationRow> calibration;  ///< if any of it is estimated

  void add(const Update& update);
};

/// Columns and rows of states.csv, everything that does not depend on wall time.
std::string states_csv_header();
std::string states_csv_row(const Update& update);
/// Columns and rows of states_imu.csv: the state at each IMU sample.
std::string imu_states_csv_header();
std::string imu_states_csv_row(const FusionState& state);
/// Columns and rows of latency.csv: wall time by stage.
std::string latency_csv_header();
std::string latency_csv_row(const Update& update);

}  // namespace evpose
