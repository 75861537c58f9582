// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "evpose/fusion/state.h"

namespace evpose {

/// Holds the IMU against the camera: turn and bend of the path over a short while as the one integrates them
/// and as the estimate, led by the contours, has them. A clock that has jumped, an axis of a wrong scale or
/// sign, or a reading that is frozen shows as a difference that neither noise nor bias explains.
/// The bend is p(t) - 2 p(t - T) + p(t - 2 T): it needs no velocity, which contours alone tell badly.
class ImuAgreement {
 public:
  /// The estimate comes from elsewhere: what was before does not count.
  void restart() { past_.clear(), first_ = 0; }
  /// A step of the IMU from the estimate's time on, with the densities of its noise.
  void add_step(const ImuSample& a, const ImuSample& b, const FusionState& from,
                const Eigen::Vector3d& gravity_map, const ImuNoise& noise);
  /// The estimate after an update, and whether the IMU's stamps are doubted. The difference in standard
  /// deviations; 0 while there is too little to tell.
  double judge(const FusionState& state, bool doubted);
  /// Whether the IMU is not to be relied on at time t.
  bool distrusted(TimeNs t) const { return t < distrust_until_; }

 private:
  /// By columns: acceleration without its bias, the biases taken off, a force along each axis of the body.
  using Forces = Eigen::Matrix<double, 3, 5>;
  struct Moment {
    TimeNs t = 0;
    Eigen::Quaterniond estimate = Eigen::Quaterniond::Identity();  ///< R_map_body
    Eigen::Quaterniond integral = Eigen::Quaterniond::Identity();  ///< of the gyroscope, from some start
    Eigen::Vector3d bias_integral = Eigen::Vector3d::Zero();       ///< of the biases taken off, rad
    double noise = 0;                                              ///< variance of the integral, rad^2
    Eigen::Vector3d bias = Eigen::Vector3d::Zero();
    double rotation_variance = 0, bias_variance = 0;  ///< of one axis, of the worst
    // Likewise of the position, in the map: what the columns of Forces add up to, once and twice.
    Eigen::Vector3d position = Eigen::Vector3d::Zero(), force_bias = Eigen::Vector3d::Zero();
    Forces once = Forces::Zero(), twice = Forces::Zero();
    double force_noise = 0;  ///< variance of the velocity that it makes, m^2/s^2
    double position_variance = 0, force_bias_variance = 0;
  };
  /// The last moment that lies so far back, if there is any.
  const Moment* before(double back_s) const;
  double turn_difference(const Moment& then) const;
  double bend_difference(const Moment& begin, const Moment& middle) const;

  Moment now_;
  std::vector<Moment> past_;  ///< at the updates, in order of time
  std::size_t first_ = 0;     ///< of past_ that is still needed
  TimeNs distrust_until_ = 0;
};

}  // namespace evpose
