// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/imu/strapdown.h"

namespace evpose {

/// Standard deviation of a position and a rotation that the edges of one slice tell, per axis.
inline constexpr double kEdgePositionSigma_m = 0.02, kEdgeRotationSigma_rad = 5e-3;

/// Of the vehicle when a search begins: it may fly fast in any direction.
inline constexpr double kUnknownVelocitySigma_m_s = 2;

/// Where a pose at constant velocity and angular rate (rad/s, body) has come to after so long; before, where
/// that is negative.
inline Pose carried_on(const Pose& T_map_body, const Eigen::Vector3d& velocity,
                       const Eigen::Vector3d& angular_rate, double s) {
  return {T_map_body.q * so3::exp(s * angular_rate), T_map_body.p + s * velocity};
}

/// A pose that may be the true one, with its velocity. Each axis of position and velocity has a Kalman filter
/// of two states, each axis of rotation one of one state; the axes share their variances.
struct PoseHypothesis {
  NavState nav;
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();  ///< rad/s, body; without a gyroscope
  double position_variance = 0, velocity_variance = 0, position_velocity_covariance = 0;
  double rotation_variance = 0;
  double concentration = 0;  ///< gate concentration of its events in the last slice
  double support = 0;        ///< events that concentrate at the contours, in the last slice
  double explained = 0;      ///< share that these are of all events
  double mean_concentration = 0, mean_support = 0;  ///< over slices, the newest counting most
  int found = 1;                                    ///< by so many searches
  int newest_search = 0;                            ///< number of the last of these
};

/// How hypotheses move from slice to slice: by the IMU, or at constant velocity where there is none.
class HypothesisMotion {
 public:
  /// `gravity_map`: zero when there is no IMU.
  explicit HypothesisMotion(const Eigen::Vector3d& gravity_map)
      : gravity_map_(gravity_map), has_imu_(!gravity_map.isZero()) {}

  bool has_imu() const { return has_imu_; }
  /// The rate of the gyroscope, or else that of the hypothesis.
  const Eigen::Vector3d& angular_rate(const PoseHypothesis& h, const Eigen::Vector3d& gyro_rate) const {
    return has_imu_ ? gyro_rate : h.angular_rate;
  }
  /// Carries state and variances on. `rate_known`: the hypothesis has been seen in two slices or more.
  void propagate(PoseHypothesis& h, const ImuIncrement& motion, bool rate_known) const;
  /// The state at the begin of `motion` from `nav` at its end.
  NavState propagate_back(const PoseHypothesis& h, const NavState& nav, const ImuIncrement& motion) const;

 private:
  Eigen::Vector3d gravity_map_;
  bool has_imu_;
};

/// Kalman update of pose and velocity with a pose that edges tell. `innovation`: measured less predicted
/// pose, as Pose::minus.
void correct_by_edges(PoseHypothesis& h, const Vector6d& innovation);

/// Hypotheses that have come together go on as one: the first of them stays, and was found by the searches of
/// both. Best first.
void merge_duplicates(std::vector<PoseHypothesis>& hypotheses);

}  // namespace evpose
