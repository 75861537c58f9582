// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/eval/alignment.h"
#include "evpose/eval/association.h"
#include "evpose/eval/statistics.h"

namespace evpose {

struct ScoreOptions {
  AssociationOptions association;
  Alignment alignment = Alignment::none;
  double align_first_s = 0;        ///< fit over the first so many seconds of the pairs; 0: over all
  std::optional<TimeNs> from, to;  ///< judge only this part of the ground truth's span
};

/// What is judged. `estimate` and `truth` hold T_map_body in order of time. The other spans are empty, or
/// hold one entry for each pose of the estimate.
struct ScoreInput {
  std::span<const TimedPose> estimate;
  std::span<const TimedPose> truth;
  std::span<const Matrix6d> covariances;        ///< of the pose, convention of Pose::plus
  std::span<const Eigen::Vector3d> velocities;  ///< frame of the estimate, m/s
  std::span<const double> pixels_per_metre;     ///< image motion of the typical map point per metre of motion
};

/// One pair after alignment.
struct ErrorSample {
  std::size_t index = 0;  ///< of the estimate
  TimeNs t = 0;
  Pose estimate;  ///< aligned
  Pose truth;
  Eigen::Vector3d true_velocity = Eigen::Vector3d::Zero();   ///< m/s
  Eigen::Vector3d position_error = Eigen::Vector3d::Zero();  ///< estimate - truth, truth's frame, metres
  Eigen::Vector3d rotation_error = Eigen::Vector3d::Zero();  ///< Log(R_truth^T R_estimate), body frame, rad
  Vector6d sigma = Vector6d::Zero();  ///< 1-sigma of these, m and rad; 0 where not known

  double ate_mm() const { return 1e3 * position_error.norm(); }
  double are_deg() const;
};

/// Means of the squared error over its stated variance, 1 if that tells the truth: in each axis, and in the
/// direction that is least known. A sum over all axes hides a direction in which the covariance is too small.
struct DirectionNees {
  Eigen::Vector3d position = Eigen::Vector3d::Zero(), rotation = Eigen::Vector3d::Zero();  ///< body axes
  double weakest_position = 0, weakest_rotation = 0;
};

/// A part of the ground truth's span without an estimate within 20 ms.
struct Stretch {
  TimeNs from = 0, to = 0;
  double length_s() const { return to_seconds(to - from); }
};

/// Means of the relative errors over one distance in time or along the path.
struct RelativeError {
  double translation_mm = 0, rotation_deg = 0;
};

/// Accuracy of a trajectory. Absent where the input does not tell.
struct TrajectoryScore {
  std::size_t pairs = 0;
  double coverage =
      0;  ///< share of a 10 ms grid over the ground truth's span within 20 ms of a paired estimate
  std::vector<Stretch> lost;
  Alignment alignment = Alignment::none;
  Similarity T_truth_estimate;  ///< the alignment found

  Statistics ate_mm, are_deg;  ///< meaningful if pairs > 0
  std::optional<RelativeError> over_10ms, over_100ms, over_1s, over_1m;
  std::optional<double> velocity_rmse_mm_s;
  std::optional<double> lag_ms;                 ///< > 0: the estimate is behind
  std::optional<double> lag_standard_error_ms;  ///< errors may be alike within half a second
  std::optional<double> along_motion_px;        ///< mean error along the motion; > 0: ahead
  std::optional<double> nees6_mean;             ///< NEES / 6: 1 if the covariance tells the truth
  std::optional<double> nees6_in_band;          ///< share of single NEES within the 95 % band, 0..1
  std::optional<DirectionNees> nees_by_direction;
  std::optional<double> jitter_mm;  ///< RMS of consecutive motion minus true motion

  std::vector<ErrorSample> samples;  ///< the series behind the figures

  /// The known figures by their stable words ("ate_mean_mm", ...), in a fixed order.
  std::vector<std::pair<std::string, double>> words() const;
};

/// With fewer than two pairs the score has no figures and coverage 0.
TrajectoryScore score_trajectory(const ScoreInput& input, const ScoreOptions& options);

}  // namespace evpose
