// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evpose/batch/batch_estimator.h"
#include "evpose/calibrate/board_start.h"
#include "evpose/calibrate/residual_field.h"

namespace evpose {

/// What pictures of a printed board tell before anything is tracked.
struct BoardBeginning {
  Eigen::VectorXd intrinsics, intrinsics_sigma;  ///< differences from what was given
  std::vector<BoardSighting> sightings;          ///< of each recording
};

/// One calibration from several recordings of the same camera and IMU, before the same map: what does not
/// change is estimated from all of them together with the trajectory of each.
class JointCalibration {
 public:
  /// All jobs have the same calibration given.
  explicit JointCalibration(std::vector<TrackJob> jobs, std::optional<BoardBeginning> board = {});

  /// Told the share of the work, 0..1; false ends it.
  using Progress = std::function<bool(double)>;

  /// From the given calibration, believed as far as its stated sigmas say. Error: those of
  /// BatchEstimator::filter(); the contours were never found.
  Status estimate(const TrackRequest& request, const Progress& progress);
  bool interrupted() const { return interrupted_; }
  /// The passes have come to rest.
  bool converged() const { return converged_; }

  const Calibration& found() const { return parameters_->calibration(); }
  /// The IMU with the axes that were found; none without one.
  std::optional<ImuNoise> imu() const;
  /// As CalibrationSigma::correlation.
  Eigen::MatrixXd correlation() const;
  /// By how many given sigmas what the events alone say is off what was given, in the order of
  /// given_numbers(); 0 where it is known or the events do not tell.
  Eigen::VectorXd contradiction() const { return contradiction_; }

  const TrackJob& job(std::size_t k) const { return jobs_[k]; }
  std::size_t size() const { return jobs_.size(); }
  const BatchEstimator& flight(std::size_t k) const { return *flights_[k]; }
  /// Of the last pass: over all recordings, and of one.
  const ResidualField& residuals() const { return residuals_; }
  const ResidualField& residuals_of(std::size_t k) const { return flight_residuals_[k]; }
  /// Share of a recording's updates in the last pass at which the events agreed with the contours. How sure
  /// the body's pose is does not matter here: that of the camera in the body is not known better.
  double accepted_share(std::size_t k) const;

 private:
  Status begin_parameters();
  Status look_along_flight(const TrackRequest& request, const std::function<bool(double)>& progress);
  void begin_before_board(BatchEstimator& flight, const BoardSighting& sighting) const;
  Status begin(const TrackRequest& request, const Progress& progress);
  Expected<double> pass(const Progress& progress);
  double share_of_step(const ParameterSolution& solution);
  void judge_given(const ParameterInformation& told);
  bool go_on(const Progress& progress, double share);

  std::vector<TrackJob> jobs_;
  std::optional<BoardBeginning> board_;
  std::vector<std::unique_ptr<BatchEstimator>> flights_;
  std::shared_ptr<StaticParameters> parameters_;
  Eigen::MatrixXd coarse_correlation_;
  std::vector<ResidualField> flight_residuals_;
  ResidualField residuals_;
  Eigen::VectorXd contradiction_;
  bool interrupted_ = false, converged_ = false;
  Eigen::VectorXd last_step_;  ///< of the calibration
  double step_share_ = 1;
  double done_ = 0;  ///< steps of the work
};

}  // namespace evpose
