// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/registration/pose_search.h"

namespace evpose {

/// Tangents of the half angles of view; of an image that is wider than 2.5, the rim is left out.
Eigen::Vector2d half_view(const Camera& camera);

/// Scores of a pose, and of those that differ from it by a turn of the camera: these move all contours alike
/// in the image, so that one projection of the contours tells 256 of them. A contour point is scored by where
/// it is seen, and in which direction, for a camera without distortion: one look-up.
class CoarseScores {
 public:
  /// `seen_share`, `outside_score`: as in score_pose().
  CoarseScores(const EdgeField& field, const Camera& camera, float seen_share, float outside_score);

  /// Positions and tangents of the points to ask, relative to `origin`.
  void set_points(std::span<const SearchPoint> points, const Eigen::Vector3d& origin);

  /// The best of 16 x 16 turns, of 2 px each.
  struct Turned {
    Eigen::Vector3d turn;  ///< rotation vector, camera frame: R_map_cam becomes R_map_cam * exp(turn)
    double score;          ///< mean over the points; what score_pose() says up to the table's steps
  };
  Turned best_turn(const Eigen::Matrix3f& R_cam_map, const Eigen::Vector3f& offset) const;

 private:
  static constexpr int kTurns = 16;  ///< along each axis of the image
  std::size_t entry(int column, int row, int direction) const {
    return (static_cast<std::size_t>(direction) * static_cast<std::size_t>(rows_) +
            static_cast<std::size_t>(row)) *
               static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
  /// Where the points are seen, of those in the table.
  std::span<const std::int32_t> find_entries(const Eigen::Matrix3f& R, const Eigen::Vector3f& t) const;
  /// Of each turn, what these points add.
  void add_turns(std::span<const std::int32_t> entries, std::uint32_t* sums) const;
  void fill_cell(const EdgeField& field, const Camera& camera, int column, int row, float seen_share);
  std::uint8_t steps(float score) const;

  float cells_per_unit_;            ///< of the tangent of the angle to the optical axis
  float half_width_, half_height_;  ///< of the table, cells
  int columns_, rows_;
  float outside_score_;
  float lowest_;                      ///< score of a step of zero
  std::vector<std::uint8_t> scores_;  ///< steps; one table for each direction, with a rim of kTurns / 2 cells
  std::vector<float> points_;         ///< six arrays: position and tangent
  std::size_t count_ = 0, padded_ = 0;  ///< length of the points, and of the arrays
  mutable std::vector<std::int32_t> entries_;
};

}  // namespace evpose
