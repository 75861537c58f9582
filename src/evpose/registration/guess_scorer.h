// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <random>

#include "evpose/registration/coarse_ranking.h"
#include "evpose/registration/pose_search.h"

namespace evpose {

/// Six numbers of a standard normal distribution, the same on every platform.
Vector6d standard_normal(std::mt19937& random);

/// Scores poses of the body with all small turns of the camera at once (CoarseScores).
class GuessScorer {
 public:
  static constexpr double kSeenShare = 0.3;      ///< of the contours in view, motion makes so many visible
  static constexpr double kOutsideScore = -0.3;  ///< of a point that has left the image: neither good nor bad

  /// Poses are near `origin`, map frame.
  GuessScorer(const SearchView& view, const Eigen::Vector3d& origin, unsigned seed);

  /// This pose, turned as the edges like it best.
  PoseGuess turned(const Pose& T_map_body) const;

  /// Moves on to better poses around this one by random steps of so many pixels, which become smaller: peaks
  /// are four pixels wide, and refine_pose() does not reach further.
  void improve(PoseGuess& guess, double reach_px);

  std::mt19937& random() { return random_; }

 private:
  CoarseScores scores_;
  Pose T_body_cam_, T_cam_body_;
  double focal_px_, half_width_px_;
  Eigen::Vector3d origin_;
  std::mt19937 random_;
};

}  // namespace evpose
