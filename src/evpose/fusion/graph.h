// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/error_state_filter.h"
#include "evpose/fusion/window.h"

namespace evpose {

/// The paper's later stage: inter-TS fusion of the newest state at every update (eq. 5), joint optimisation
/// of the window after every few (eq. 6), whose newest state is carried on from there. The window keeps the
/// normal equations of a measurement as they were where it was measured.
class Graph : public BackEnd {
 public:
  Graph(const StatePropagator& propagator, double window_s);

  using BackEnd::start;
  using BackEnd::update;
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  const FusionState& state() const override { return filter_.state(); }

  const Window& window() const { return window_; }

 private:
  void take_newest();

  double window_s_;
  Window window_;
  ErrorStateFilter filter_;  ///< of the newest state
  JointMeasurement measurement_;
  Preintegration since_;  ///< motion since the window's newest state
  int waiting_ = 0;       ///< updates since the last joint optimisation
};

}  // namespace evpose
