// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/map/contour_map.h"

namespace evpose {

/// Depth of the nearest surface over a grid of the normalised image plane (x / z, y / z): small, refreshed
/// when the view has moved, asked for each candidate point (EV-Pose 5.3, "occlusion-aware").
class DepthBuffer {
 public:
  /// Covers |x / z|, |y / z| <= tangents, with square cells of `cell` (tangent units).
  DepthBuffer(const Eigen::Vector2d& tangents, double cell);

  /// Empties the grid and looks from a new place.
  void reset_view(const ContourMap& map, const Pose& T_map_cam, double near_m);
  /// Draws triangles of that map, by number; what is nearer than `near_m` is cut off. Returns how many cells
  /// were filled.
  std::size_t draw(const ContourMap& map, std::span<const std::uint32_t> triangles);
  /// Both, with all triangles.
  void render(const ContourMap& map, const Pose& T_map_cam, double near_m);

  /// True if a surface stands before the point. The surface that holds the cell is asked at the point itself,
  /// so that the edge of a thin board is not hidden by its own faces, and its far edge is. Points beside a
  /// much nearer silhouette count as hidden: which of the two an event belongs to is open.
  bool hides(const Eigen::Vector3d& point_cam) const;

  /// Depth of the surface that is seen at (x / z, y / z), exactly there, by the nearest cell; none: nothing
  /// is.
  std::optional<double> depth_at(const Eigen::Vector2f& tangents) const;

  /// The triangle that is seen at (x / z, y / z), by its number in the map, at the nearest cell; none:
  /// nothing is.
  std::optional<std::uint32_t> triangle_at(const Eigen::Vector2f& tangents) const;

 private:
  std::size_t draw(Eigen::Vector3f a, Eigen::Vector3f b, Eigen::Vector3f c, const Eigen::Vector3f& slope);
  std::optional<std::size_t> cell_at(const Eigen::Vector2f& tangents) const;
  std::size_t clip_and_draw(const Eigen::Vector3f* corners);

  Eigen::Vector2f tangents_;
  float cell_;
  int columns_, rows_;
  std::vector<float> inverse_depths_;    ///< of the nearest surface at each cell's centre, 0: none
  std::vector<std::uint32_t> surfaces_;  ///< its number
  /// Of the surfaces: at (x / z, y / z) its 1 / z is slope . (x / z, y / z, 1).
  std::vector<Eigen::Vector3f> slopes_;
  std::vector<std::uint32_t> triangles_;  ///< of the surfaces, in the map
  Eigen::Matrix3f R_cam_map_;
  Eigen::Vector3f offset_;  ///< of the map's anchor, camera frame
  float near_m_ = 0;
};

}  // namespace evpose
