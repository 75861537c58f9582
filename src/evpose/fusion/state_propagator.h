// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/state.h"
#include "evpose/imu/imu.h"

namespace evpose {

struct FusionConfig;

/// How far a step of the IMU is to be relied on.
enum class ImuTrust {
  good,
  suspect,  ///< a reading is a guess, or the time between two is long: the noise of a vehicle that nobody
            ///< measures
  none      ///< wrong altogether, for long: and the gyroscope's bias becomes what is wrong with its reading
};

/// Carries a state and its covariance forward, by the IMU or by constant velocity (EV-Pose eq. 2). Without
/// an IMU it is the same model on a gyroscope that reads zero: its "bias" is then minus the angular rate.
class StatePropagator {
 public:
  StatePropagator(MotionModel model, const FusionConfig& config, const ImuNoise& noise);

  MotionModel model() const { return model_; }
  /// In the map, m/s^2; zero where no accelerometer is to be freed of it.
  const Eigen::Vector3d& gravity_map() const { return gravity_map_; }
  void set_gravity_map(const Eigen::Vector3d& gravity) { gravity_map_ = gravity; }
  /// Densities in use: the IMU's times the configured scale, or those of a step that is not to be relied on.
  const ImuNoise& noise(ImuTrust trust = ImuTrust::good) const {
    return trust == ImuTrust::good ? noise_ : trust == ImuTrust::suspect ? suspect_noise_ : blind_noise_;
  }
  /// The same with what faults of scale and alignment add at this motion (body frame, rad/s, m/s^2).
  ImuNoise noise_at(const Eigen::Vector3d& rate, const Eigen::Vector3d& force, ImuTrust trust) const;

  /// The state at the start, with its configured uncertainty. The rate is used by constant velocity only.
  FusionState initial_state(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body) const;

  /// IMU model: one step between two samples in the body frame; a.t must be the state's time.
  /// `transition`: what becomes of the state's error.
  void propagate(FusionState& state, const ImuSample& a, const ImuSample& b, ImuTrust trust = ImuTrust::good,
                 Matrix15d* transition = nullptr) const;
  /// Constant velocity: to time t >= the state's.
  void propagate(FusionState& state, TimeNs t, Matrix15d* transition = nullptr) const;

 private:
  void propagate_covariance(FusionState& state, const NavState& before, const Eigen::Vector3d& rate,
                            const Eigen::Vector3d& force, double dt_s, ImuTrust trust,
                            Matrix15d* transition) const;

  MotionModel model_;
  Eigen::Vector3d gravity_map_;
  ImuNoise noise_, suspect_noise_, blind_noise_;
  double scale_sigma_;
  Vector15d start_sigma_;
};

}  // namespace evpose
