// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/window.h"

namespace evpose {

/// The paper's later stage: inter-TS fusion of the newest state at every update (eq. 5), joint optimisation
/// of the window after every few (eq. 6), whose newest state is carried on from there. Both have the motion
/// prior (eq. 2), the measurement (eq. 3) and the IMU (eq. 4) as factors; without an IMU the prior alone ties
/// states to each other. The window keeps the normal equations of a measurement as they were where it was
/// measured.
class Graph : public BackEnd {
 public:
  Graph(const StatePropagator& propagator, const FusionConfig& config);

  using BackEnd::start;
  using BackEnd::update;
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  const FusionState& state() const override { return state_; }

  const Window& window() const { return window_; }

 private:
  void take_newest();

  double window_s_;
  Window window_;
  FusionState state_;
  Preintegration since_;  ///< motion since the window's newest state
  int waiting_ = 0;       ///< updates since the last joint optimisation
};

}  // namespace evpose
