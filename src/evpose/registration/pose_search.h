// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/pose.h"
#include "evpose/registration/edge_field.h"

namespace evpose {

/// Of contours, where metres of position are compared with pixels or angles.
constexpr double kTypicalDepth_m = 3;

/// A contour point, map frame.
struct SearchPoint {
  Eigen::Vector3d position, tangent;
};

/// Edges, and the contour points that are compared with them.
struct SearchView {
  const EdgeField& field;
  const Camera& camera;
  const Pose& T_body_cam;
  std::span<const SearchPoint> points;
};

struct PoseGuess {
  Pose T_map_body;
  /// Mean logarithm, over the points, of the likelihood of an edge there against the background.
  /// search_pose() adds the prior's share.
  double score = 0;
};

/// What is known of the pose before.
struct PosePrior {
  Pose T_map_body;
  Matrix6d covariance;  ///< perturbed as Pose::plus
  /// R_map_body by other means, from which most poses are drawn, if any; within this of the true one, 1
  /// sigma.
  std::vector<Eigen::Quaterniond> attitudes = {};
  double attitude_sigma_rad = 0;
};

/// Coarse search (design.md 5.6 and 5.9): poses are drawn from the prior and compared by how many contours
/// lie on edges of their direction. The best are moved on by small random steps, then by iterated least
/// squares from a wide kernel to a narrow one. Contours in textured places count little, as an edge is near
/// there at any pose. Returns the best poses that differ, best first.
std::vector<PoseGuess> search_pose(const SearchView& view, const PosePrior& prior, unsigned seed);

/// Moves a pose to the optimum near by; contours may be up to `from_px` away from their edges. The prior
/// holds the directions that the contours leave open.
PoseGuess refine_pose(const SearchView& view, const Pose& from, const Matrix6d& prior_information,
                      double from_px);

/// Score of a pose.
double score_pose(const SearchView& view, const Pose& T_map_body, EdgeSpread spread);

/// How far contours may be off when a guess is refined, px.
double refine_reach_px();

}  // namespace evpose
