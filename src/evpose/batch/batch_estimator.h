// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "evpose/batch/chain_smoother.h"
#include "evpose/batch/following_back_end.h"
#include "evpose/batch/static_parameters.h"
#include "evpose/core/error.h"
#include "evpose/run/track_recording.h"

namespace evpose {

/// The trajectory of a recording together with what does not change over it, by Gauss-Newton on all data: the
/// filter's estimate first, then passes over the events that measure along the last estimate and correct all
/// of it at once. Several recordings may share what does not change: the owner of the parameters then lets
/// each measure(), solves for all of them, and lets each take() what was found.
class BatchEstimator {
 public:
  explicit BatchEstimator(TrackJob job, std::shared_ptr<StaticParameters> parameters = nullptr)
      : job_(std::move(job)), parameters_(std::move(parameters)) {}

  /// 1 sigma along and about each axis.
  struct StartSigma {
    double position_m = 0, rotation_rad = 0;
  };
  /// Begins there instead of at the job's start. `of_passes`: how far the passes may move the start, at
  /// least; the filter takes the start for as good as configured.
  void begin_at(const StartState& start, const StartSigma& of_passes) {
    job_.start = start;
    of_passes_ = of_passes;
  }

  /// What is told the share of a pass, 0..1, and ends it by false.
  using Progress = std::function<bool(double)>;

  /// The filter's run, from what is known of the parameters by now. `correlation`: of their errors, as
  /// CalibrationSigma has it; empty: independent. Error: a recording that cannot be read, or in which nothing
  /// comes into view.
  Status filter(const TrackRequest& request, const Progress& progress,
                const Eigen::MatrixXd& correlation = {});
  /// In place of filter(), what another run has estimated: the states at the start and at each update after
  /// it, with the covariances of their poses, and the calibration. The start is the first state's.
  Status begin_along(std::vector<FusionState> trajectory, const Calibration& found);
  /// One pass; by how much it has moved the poses and the calibration, in sigma: the larger of the poses' RMS
  /// and of the largest number of the calibration. Interrupted: nothing has changed.
  Expected<double> iterate(const TrackRequest& request, const Progress& progress);
  bool interrupted() const { return interrupted_; }

  /// The parts of a pass. measure() along the trajectory: what is said of the parameters.
  Expected<ParameterInformation> measure(const Progress& progress);
  /// The trajectory given the parameters, or a share of the way there; by how much its poses would move, RMS,
  /// in sigma.
  double take(const ParameterSolution& found, double share = 1);
  /// After filter().
  const std::shared_ptr<StaticParameters>& parameters() const { return parameters_; }
  /// Told of what is measured in each pass.
  void on_contours(ContourCallback callback) { contour_callback_ = std::move(callback); }

  /// At the start and at each update, by all passes until now.
  const std::vector<FusionState>& trajectory() const { return trajectory_; }
  /// Of the last pass: what was measured, at the trajectory before it.
  const std::vector<Update>& updates() const { return updates_; }
  const RunSummary& summary() const { return summary_; }
  /// Of each point of the map, by how much its segment stands off, map frame, m; empty: not estimated.
  std::vector<Eigen::Vector3d> displacements() const;
  /// The job with the calibration as it is known now.
  TrackJob at_present_values() const;
  /// What the present or last pass measures with.
  const TrackerSetup& followed() const { return followed_; }

 private:
  Expected<std::unique_ptr<Tracker>> make_filter(const Eigen::MatrixXd& correlation = {});
  Expected<std::unique_ptr<Tracker>> follow(const Progress& progress);

  TrackJob job_;
  std::vector<FusionState> trajectory_;
  std::vector<Update> updates_;
  ChainSmoother chain_;
  RunSummary summary_;
  std::shared_ptr<StaticParameters> parameters_;  ///< after the filter's run
  StartSigma of_passes_;
  ContourCallback contour_callback_;
  TrackerSetup followed_;
  bool interrupted_ = false;
};

}  // namespace evpose
