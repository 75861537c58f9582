// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/relocalization/edge_lines.h"

namespace evpose {

/// Contour points in the camera's frame, each with the direction in which its contour is seen.
class SeenPoints {
 public:
  void clear() { count_ = 0, x_.clear(), y_.clear(), z_.clear(), direction_.clear(); }
  void add(const Eigen::Vector3f& position_cam, const Eigen::Vector3f& tangent_cam);
  /// After the last one.
  void complete();
  std::size_t size() const { return count_; }

 private:
  friend class LineScores;
  std::size_t count_ = 0;
  std::vector<float> x_, y_, z_;  ///< m; as many as make whole vectors
  std::vector<std::int32_t> direction_;
};

/// Score of a contour point by where it is seen and in which direction: the logarithm of the likelihood of a
/// line there, normally distributed about the contour, against lines at random. One look-up in a table of the
/// image without distortion, in units of the tangent of the angle to the optical axis.
class LineScores {
 public:
  /// `spread`: standard deviation of lines about contours, tangent units.
  LineScores(std::span<const EdgeLine> lines, const Camera& camera, double spread);

  /// Sum over the points, all of them shifted by `offset`, m. Points outside of the image count a little
  /// less than nothing.
  float sum(const SeenPoints& points, const Eigen::Vector3f& offset) const;
  /// Half of the image's extent, tangent units.
  const Eigen::Vector2d& half_view() const { return half_view_; }

  static constexpr int kDirections = 16;
  /// Of a line along (x, y): evenly along the sides of a square, which needs no arc tangent.
  static int direction(float x, float y);

 private:
  using Plane = std::vector<float>;
  void draw(const Eigen::Vector2d& from, const Eigen::Vector2d& to, std::vector<Plane>& distances) const;
  void transform(Plane& distances) const;
  void fill(const Plane& distances, const Camera& camera, int number, double spread);

  Eigen::Vector2d half_view_;
  float cells_per_unit_;
  int columns_, rows_;  ///< of the table, with a border outside of the image
  std::vector<float> scores_;
};

}  // namespace evpose
