// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "evpose/fusion/state.h"

namespace evpose::map_learn {

/// A short piece of a contour as an unknown of the adjustment: it may stand off in the two directions across
/// it, and its events may come later than the edge delay says.
struct Landmark {
  Eigen::Matrix<double, 3, 2> directions = Eigen::Matrix<double, 3, 2>::Zero();  ///< unit, map frame
  Eigen::Vector2d moved_m = Eigen::Vector2d::Zero();  ///< from where it was given to where it was seen
  /// Of where it was given: that of the many, since it may stand on another edge or surface altogether.
  Eigen::Vector2d sigma_m = Eigen::Vector2d::Ones();
  /// By which unknowns that it shares with others its given place is displaced: number of the unknown, and
  /// displacement by its unit, map frame. Its sigma is that of what is left.
  std::vector<std::pair<Eigen::Index, Eigen::Vector3d>> shared = {};
};

/// What the events of one landmark said over a short time, at the present trajectory and place of it:
///   offset_px = by_pose . (pose error) + by_point . (its displacement) + forward * (extra delay) + noise.
struct Observation {
  std::uint32_t landmark = 0;
  std::uint32_t knot = 0;  ///< the pose's error lies between this knot's and the next one's
  double share = 0;        ///< of the next one, 0..1
  Vector6d by_pose = Vector6d::Zero();
  Eigen::Vector3d by_point = Eigen::Vector3d::Zero();  ///< px/m, map frame
  double offset_px = 0;
  double forward = 0;       ///< +1, -1: sense of the contour's motion; less where it is slow
  double variance_px2 = 1;  ///< as one of many: what lasts longer than one of them is counted in it
  double scatter_px2 = 1;   ///< its own variance, by which it is judged
};

/// From one knot to the next: d_next = transition d - offset + noise.
struct KnotStep {
  Matrix15d transition = Matrix15d::Identity(), noise = Matrix15d::Identity();
  Vector15d offset = Vector15d::Zero();
};

/// Trajectory and landmarks of one flight. The unknowns are errors of the states at the knots (15 each),
/// one delay of all events, what landmarks share, and three of each landmark, which are eliminated: what is
/// left is the size of the knots.
struct AdjustmentProblem {
  std::vector<KnotStep> steps;  ///< one less than there are knots
  /// Of the first state, beside the recording: its error d has d + start_offset ~ N(0, start_covariance).
  Matrix15d start_covariance = Matrix15d::Identity();
  Vector15d start_offset = Vector15d::Zero();
  std::vector<Landmark> landmarks;
  std::vector<Observation> observations;  ///< those of a landmark together, in the order of their landmarks
  double delay_sigma_px = 0.05, own_delay_sigma_px = 0.08;
  Eigen::VectorXd shared;             ///< what landmarks share, as known by now; their prior is zero
  Eigen::MatrixXd shared_covariance;  ///< of that prior

  std::size_t knots() const { return steps.size() + 1; }
};

struct LandmarkEstimate {
  Eigen::Vector2d move_m = Eigen::Vector2d::Zero();      ///< along its directions
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< of its place, the trajectory's share included
  double seen_variance_m2 = 0;  ///< of it across the contour in the image, from where it was seen
  double chi2 = 0;              ///< mean of (residual / sigma)^2 of its observations, cut off at 9
  int observations = 0;
  double delay_px = 0;  ///< of its events, beside that of all
};

struct AdjustmentResult {
  std::vector<Vector15d> states;  ///< errors at the knots
  double delay_px = 0;
  Eigen::VectorXd shared;  ///< what landmarks share, as known now
  std::vector<LandmarkEstimate> landmarks;
  /// Of the mean position and mean attitude error (map frame, m and rad) of the knots: what all that was
  /// learnt has in common.
  Matrix6d common_covariance = Matrix6d::Zero();
  std::vector<Matrix6d> pose_covariances;  ///< at the knots
};

/// Weighted least squares; observations and the places of landmarks count less the further they lie
/// off (solved again with new weights, `reweightings` times). Deterministic. `R_map_body`: at the knots.
AdjustmentResult adjust(const AdjustmentProblem& problem, const std::vector<Eigen::Matrix3d>& R_map_body,
                        int reweightings = 6);

}  // namespace evpose::map_learn
