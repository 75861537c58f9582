// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/registration/pose_search.h"

namespace evpose {

/// Tangents of the half angles of view; of an image that is wider than 2.5, the rim is left out.
Eigen::Vector2d half_view(const Camera& camera);

/// Score of a contour point by where it is seen, and in which direction, for a camera without distortion: one
/// look-up. It is made from an edge field and is as coarse as EdgeSpread::coarse allows.
class CoarseScores {
 public:
  /// `seen_share`, `outside_score`: as in score_pose().
  CoarseScores(const EdgeField& field, const Camera& camera, float seen_share, float outside_score);

  /// Mean over the points; what score_pose() says of them up to the table's steps.
  double score(const Eigen::Matrix3f& R_cam_map, const Eigen::Vector3f& offset) const;
  /// Positions and tangents of every `step`-th of the points to ask, relative to `origin`.
  void set_points(std::span<const SearchPoint> points, std::size_t step, const Eigen::Vector3d& origin);

 private:
  std::size_t entry(int column, int row, int direction) const {
    return (static_cast<std::size_t>(direction) * static_cast<std::size_t>(rows_) +
            static_cast<std::size_t>(row)) *
               static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
  void fill_cell(const EdgeField& field, const Camera& camera, int column, int row, float seen_share);

  float cells_per_unit_;            ///< of the tangent of the angle to the optical axis
  float half_width_, half_height_;  ///< of the table, cells
  int columns_, rows_;
  std::vector<float> scores_;  ///< one table for each direction, then the score outside of the image
  std::vector<float> points_;  ///< six arrays: position and tangent
  std::size_t count_ = 0;
  mutable std::vector<std::int32_t> entries_;
};

}  // namespace evpose
