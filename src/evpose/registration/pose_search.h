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

class ConfigTable;

struct PoseSearchConfig {
  int guesses = 8000;       ///< drawn from the prior
  int refined = 80;         ///< the best of them are refined
  int kept = 16;            ///< the best of these, that differ, are handed on
  double coarse_px = 6;     ///< spread of edges about contours when guesses are compared
  double fine_px = 1.5;     ///< ... and when refined poses are
  double seen_share = 0.3;  ///< of the contours in view that the motion makes visible
};
void describe(ConfigTable& table, PoseSearchConfig& config);

/// A contour point, map frame.
struct SearchPoint {
  Eigen::Vector3d position, tangent;
};

/// What the search looks at.
struct SearchView {
  const EdgeField& field;
  const Camera& camera;
  const Pose& T_body_cam;
  std::span<const SearchPoint> points;
};

struct PoseGuess {
  Pose T_map_body;
  double score =
      0;  ///< mean log-odds of a point to lie on an edge rather than anywhere, with the prior's share
};

/// The coarse stage that design 5.6 and 5.9 ask for: poses drawn from the prior, compared by how many
/// contours lie on edges of their direction, the best refined by iterated least squares from wide to narrow.
/// Contours in textured places count little, as an edge is near there at any pose.
class PoseSearch {
 public:
  explicit PoseSearch(const PoseSearchConfig& config) : config_(config) {}

  /// The best poses that differ, best first. `covariance` is of `prior`, perturbed as Pose::plus.
  std::vector<PoseGuess> search(const SearchView& view, const Pose& prior, const Matrix6d& covariance,
                                unsigned seed) const;

  /// Moves a pose to the optimum near by; `from_px` is how far contours may be off. The prior holds what the
  /// contours do not.
  PoseGuess refine(const SearchView& view, const Pose& from, const Matrix6d& prior_information,
                   double from_px) const;

  /// `spread`: of EdgeField, 0 coarse, 1 fine.
  double score(const SearchView& view, const Pose& T_map_body, int spread, std::size_t step = 1) const;

 private:
  PoseSearchConfig config_;
};

}  // namespace evpose
