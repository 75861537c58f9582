// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"

namespace evpose {

/// Kalman update of the state at its own time by a measurement relative to its pose (EV-Pose eq. 5).
void correct(FusionState& state, const PoseInformation& measurement);

/// Error-state Kalman filter on T_map_body, velocity and IMU biases: the fusion of prediction (EV-Pose eq. 2,
/// 4) and pose measurement (eq. 3, 5) for one newest state.
class Ekf : public BackEnd {
 public:
  explicit Ekf(const Motion& motion) : BackEnd(motion) {}

  void start(TimeNs t, const NavState& nav, const Eigen::Vector3d& angular_rate_body) override {
    state_ = motion().start(t, nav, angular_rate_body);
  }
  void predict(const ImuSample& a, const ImuSample& b) override { motion().step(state_, a, b); }
  void predict(TimeNs t) override { motion().step(state_, t); }
  void update(const PoseInformation& measurement) override { correct(state_, measurement); }
  const FusionState& state() const override { return state_; }

 private:
  FusionState state_;
};

}  // namespace evpose
