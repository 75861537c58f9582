// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "evpose/fusion/state.h"

namespace evpose {

/// The motion prior of the graph (EV-Pose eq. 2): from one state to the next the body keeps its velocity and
/// its angular rate, but for white accelerations. It is weak beside an IMU, and beside that factor, not
/// instead of it, it enters eq. (5) and (6).
class MotionPrior {
 public:
  using Vector9d = Eigen::Matrix<double, 9, 1>;
  using Matrix9d = Eigen::Matrix<double, 9, 9>;

  /// Densities of the white accelerations, m/s^2/sqrt(Hz) and rad/s^2/sqrt(Hz).
  MotionPrior(double accel_density, double angular_density)
      : accel_density_(accel_density), angular_density_(angular_density) {}

  struct Residual {
    Vector9d value;                                 ///< (p, phi, v); zero where nothing accelerates
    Eigen::Matrix<double, 9, 15> by_start, by_end;  ///< derivatives by the error states of i and j
  };
  /// `i` has the angular rate that is kept.
  Residual residual(const FusionState& i, const FusionState& j) const;
  /// Of the residual over a time of `dt_s` > 0.
  Matrix9d covariance(double dt_s) const;

 private:
  double accel_density_, angular_density_;
};

}  // namespace evpose
