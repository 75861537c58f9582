// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/tracker/pose_evidence.h"

namespace evpose {

/// Ambiguous: several poses explain the events alike, and none is believed.
enum class Health { waiting, initialising, tracking, degraded, ambiguous, lost };
inline constexpr std::array kHealths{Health::waiting,  Health::initialising, Health::tracking,
                                     Health::degraded, Health::ambiguous,    Health::lost};
const char* to_string(Health health);
/// There is a pose, be it one that is not confirmed.
inline bool has_pose(Health h) {
  return h == Health::initialising || h == Health::tracking || h == Health::degraded;
}

/// Wall time of one update by stage, seconds. Filled by the tracker from a clock that the driver hands in;
/// nothing in the estimate depends on it.
struct StageTimes {
  double choose_s = 0;    ///< choice of points and their bands, before the events came
  double events_s = 0;    ///< the events since the last update, as they came
  double predict_s = 0;   ///< IMU or constant-velocity propagation
  double register_s = 0;  ///< alignment of the points with the events
  double fuse_s = 0;      ///< Kalman update and judgement
  double after_newest_event_s() const { return predict_s + register_s + fuse_s; }
};

/// Everything the tracker says about one instant: a row of states.csv.
struct Update {
  TimeNs t = 0;
  Pose T_map_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();      ///< of the body's origin, map frame, m/s
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();     ///< rad/s; without IMU: minus the angular rate
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();    ///< m/s^2
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();  ///< body frame, without its bias, rad/s
  Matrix6d covariance = Matrix6d::Zero();  ///< of T_map_body: (translation, rotation), m^2, rad^2
  Eigen::Matrix3d velocity_covariance = Eigen::Matrix3d::Zero();  ///< map frame, m^2/s^2
  Health health = Health::waiting;
  std::string reason;            ///< of the health, in words; set when it changed, else empty
  std::vector<Pose> candidates;  ///< while ambiguous: values that T_map_body may have, likeliest first
  double probability = 0;  ///< that the pose is the right one, not one that happens to agree with events
  PoseEvidence look;       ///< which tells that, with the next one
  double gate_concentration = 0;    ///< of the events about the contours: 0 if they lie evenly, 1 in one line
  bool accepted = false;            ///< the registration passed the innovation gate and was used
  std::int32_t events_read = 0;     ///< since the last update
  std::int32_t events_shed = 0;     ///< of these, left out because too many came (events.most_mev_s)
  std::int32_t events_kept = 0;     ///< of these, passed by the noise filter
  double share = 1;                 ///< of the contours whose events were looked at; less: too many came
  std::int32_t points = 0;          ///< chosen map points
  std::int32_t points_matched = 0;  ///< of these, with events near by
  std::int32_t events_matched = 0;  ///< events in the gate (field: events)
  std::int32_t wrong_polarity = 0;  ///< events in the gate left out for their polarity
  std::int32_t other_motion = 0;    ///< events in the gate of cells that move otherwise
  double residual = 0;              ///< RMS of event distances, px (events); of the loss, 0..1 (exponential)
  double innovation = 0;            ///< normalised innovation squared / 6
  StageTimes times;
};

}  // namespace evpose
