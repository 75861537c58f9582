// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/state.h"
#include "evpose/imu/imu.h"

namespace evpose {

/// IMU samples between two states summed up on the manifold, independent of the state they start from
/// (Forster et al., "On-Manifold Preintegration", 2017; EV-Pose eq. 4). Increments stand in the body frame of
/// the start, with biases as given; what a small change of the biases does is kept to first order.
class Preintegration {
 public:
  Preintegration(const Eigen::Vector3d& gyro_bias, const Eigen::Vector3d& accel_bias)
      : gyro_bias_(gyro_bias), accel_bias_(accel_bias) {}

  /// Samples in the body frame, in order of time, of any spacing; `noise` are densities. Samples that repeat
  /// a time or go back are left out and counted.
  void add(const ImuSample& a, const ImuSample& b, const ImuNoise& noise);

  double dt_s() const { return sum_.dt_s; }
  double longest_step_s() const { return longest_step_s_; }
  int left_out() const { return left_out_; }
  /// Of the errors (p, phi, v, b_g, b_a) of the increments, p and v in the start's body frame, phi in the
  /// end's; with the random walk of the biases.
  const Matrix15d& covariance() const { return covariance_; }

  /// The increments for other biases, to first order.
  ImuIncrement corrected(const Eigen::Vector3d& gyro_bias, const Eigen::Vector3d& accel_bias) const;

  /// The state at the end that follows from one at the start, noise-free. Covariance and time are not set.
  FusionState predict(const FusionState& start, const Eigen::Vector3d& gravity_map) const;

  struct Residual {
    Vector15d value;             ///< zero where j == predict(i)
    Matrix15d by_start, by_end;  ///< derivatives by the error states of i and j
  };
  Residual residual(const FusionState& i, const FusionState& j, const Eigen::Vector3d& gravity_map) const;

 private:
  Eigen::Vector3d gyro_bias_, accel_bias_;
  ImuIncrement sum_;
  Eigen::Matrix<double, 9, 6> by_bias_ =
      Eigen::Matrix<double, 9, 6>::Zero();  ///< (dp, phi, dv) by (b_g, b_a)
  Matrix15d covariance_ = Matrix15d::Zero();
  double longest_step_s_ = 0;
  int left_out_ = 0;
};

/// Process noise of one step of `dt_s` for errors (p, phi, v, b_g, b_a): densities integrated over the step.
Matrix15d process_noise(const ImuNoise& noise, double dt_s);

}  // namespace evpose
