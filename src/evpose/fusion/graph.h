// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/window.h"

namespace evpose {

/// The paper's later stage: inter-TS fusion of the newest state at every update (eq. 5), joint optimisation
/// of the window after every few (eq. 6), whose newest state is carried on from there.
class Graph : public BackEnd {
 public:
  Graph(const Motion& motion, const WindowConfig& config);

  using BackEnd::start;
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, bool suspect) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement) override;
  const FusionState& state() const override { return state_; }

  const Window& window() const { return window_; }

 private:
  WindowConfig config_;
  Window window_;
  FusionState state_;
  Preintegration since_;  ///< motion since the window's newest state
  int waiting_ = 0;       ///< updates since the last joint optimisation
};

}  // namespace evpose
