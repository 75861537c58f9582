// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <future>
#include <optional>
#include <vector>

#include "evpose/fusion/back_end.h"
#include "evpose/fusion/window.h"

namespace evpose {

/// The paper's later stage: inter-TS fusion of the newest state at every update (eq. 5), joint optimisation
/// of the window after every few (eq. 6), whose newest state is carried on from there. In the background the
/// optimisation of one update is used a fixed number of updates later, however long it takes: what has come
/// since is then done again from its result.
class Graph : public BackEnd {
 public:
  Graph(const StatePropagator& propagator, const WindowConfig& config, Coupling coupling = Coupling::loose);

  using BackEnd::start;
  using BackEnd::update;
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  bool takes_contours() const override { return coupling_ == Coupling::tight; }
  const FusionState& state() const override { return state_; }

  const Window& window() const { return window_; }

 private:
  struct Step {
    ImuSample a, b;  ///< without an IMU: the times alone
    ImuTrust trust = ImuTrust::good;
  };
  /// An update, and the motion that led to it.
  struct Done {
    std::vector<Step> steps;
    PoseInformation measurement;
    Pose measured_at;
    std::vector<ContourOffset> contours;
  };
  void carry(const Step& step);
  void fuse(const PoseInformation& measurement, const Pose& measured_at,
            std::span<const ContourOffset> contours);
  void take_newest();
  void begin_background();
  void end_background();

  WindowConfig config_;
  Coupling coupling_;
  Window window_;
  FusionState state_;
  Preintegration since_;  ///< motion since the window's newest state
  int waiting_ = 0;       ///< updates since the last joint optimisation began
  std::future<std::optional<Window>> job_;
  std::vector<Step> steps_;      ///< since the last update, while a job runs
  std::vector<Done> since_job_;  ///< updates since it began
};

}  // namespace evpose
