// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "evpose/batch/chain_smoother.h"
#include "evpose/batch/static_parameters.h"
#include "evpose/core/error.h"
#include "evpose/run/track_recording.h"

namespace evpose {

/// The trajectory of a recording together with what does not change over it, by Gauss-Newton on all data: the
/// filter's estimate first, then passes over the events that measure along the last estimate and correct all
/// of it at once.
class BatchEstimator {
 public:
  explicit BatchEstimator(TrackJob job) : job_(std::move(job)) {}

  /// What is told the share of a pass, 0..1, and ends it by false.
  using Progress = std::function<bool(double)>;

  /// The filter's run. Error: a recording that cannot be read, or in which nothing comes into view.
  Status filter(const TrackRequest& request, const Progress& progress);
  /// One pass; by how much it has moved the poses and the calibration, in sigma: the larger of the poses' RMS
  /// and of the largest number of the calibration. Interrupted: nothing has changed.
  Expected<double> iterate(const TrackRequest& request, const Progress& progress);
  bool interrupted() const { return interrupted_; }

  /// At the start and at each update, by all passes until now.
  const std::vector<FusionState>& trajectory() const { return trajectory_; }
  /// Of the last pass: what was measured, at the trajectory before it.
  const std::vector<Update>& updates() const { return updates_; }
  const RunSummary& summary() const { return summary_; }
  /// Of each point of the map, by how much its segment stands off, map frame, m; empty: not estimated.
  std::vector<Eigen::Vector3d> displacements() const;
  /// The job with the calibration as it is known now.
  TrackJob at_present_values() const;

 private:
  Expected<std::unique_ptr<Tracker>> follow(const Progress& progress);
  double correct();

  TrackJob job_;
  std::vector<FusionState> trajectory_;
  std::vector<Update> updates_;
  ChainSmoother chain_;
  RunSummary summary_;
  std::optional<StaticParameters> parameters_;  ///< after the filter's run
  bool interrupted_ = false;
};

}  // namespace evpose
