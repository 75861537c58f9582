// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <deque>

#include "evpose/fusion/state.h"

namespace evpose {

class ConfigTable;

struct ImuAgreementConfig {
  double over_s = 0.06;     ///< turns are compared over so long
  double sigma = 2.5;       ///< a difference of so many standard deviations is a contradiction
  double distrust_s = 1.0;  ///< so long after it the IMU is not relied on
};
void describe(ConfigTable& table, ImuAgreementConfig& config);

/// Holds the gyroscope against the camera: the turn over a short while as the one integrates and as the
/// estimate, led by the contours, has it. A clock that has jumped, an axis of a wrong scale or sign, or a
/// reading that is frozen shows as a difference that neither noise nor bias explains.
class ImuAgreement {
 public:
  explicit ImuAgreement(const ImuAgreementConfig& config) : config_(config) {}

  /// The estimate comes from elsewhere.
  void forget() { past_.clear(); }
  /// A step of the IMU with the bias that the estimate had; `density` of the gyroscope's noise,
  /// rad/s/sqrt(Hz).
  void turn(const ImuSample& a, const ImuSample& b, const Eigen::Vector3d& gyro_bias, double density);
  /// The estimate after an update. The difference in standard deviations; 0 while there is too little to
  /// tell.
  double judge(const FusionState& state);
  /// Whether the IMU is not to be relied on at time t.
  bool distrusted(TimeNs t) const { return t < distrust_until_; }

 private:
  struct Moment {
    TimeNs t = 0;
    Eigen::Quaterniond estimate = Eigen::Quaterniond::Identity();  ///< R_map_body
    Eigen::Quaterniond integral = Eigen::Quaterniond::Identity();  ///< of the gyroscope, from some start
    Eigen::Vector3d bias_integral = Eigen::Vector3d::Zero();       ///< of the biases taken off, rad
    double noise = 0;                                              ///< variance of the integral, rad^2
    Eigen::Vector3d bias = Eigen::Vector3d::Zero();
    double rotation_variance = 0, bias_variance = 0;  ///< of one axis, of the worst
  };
  ImuAgreementConfig config_;
  Moment now_;
  std::deque<Moment> past_;  ///< at the updates, in order of time
  TimeNs distrust_until_ = 0;
};

}  // namespace evpose
