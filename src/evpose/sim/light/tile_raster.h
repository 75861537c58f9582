// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/light/tile.h"
#include "evpose/sim/light/triangle_shape.h"
#include "evpose/sim/world/lanes.h"

namespace evpose::sim {

inline constexpr std::int32_t kSky = -1;  ///< group where there is no surface

/// Finds the nearest of a few triangles at the centre and the corners of every pixel of a tile, or anywhere
/// in it. Exact: every direction gets what a ray would meet among these triangles.
class TileRaster {
 public:
  static constexpr int kCorners = kTilePx + 1;
  static constexpr int kCentres = kTilePixels;
  /// Centres row by row, then corners row by row (kCorners apart), then filling up.
  static constexpr int kPlaces = (kCentres + kCorners * kCorners + kLanes - 1) / kLanes * kLanes;

  struct Shape {
    TriangleShape plane;
    std::array<Eigen::Vector3d, 3> edges;  ///< as Border::function
    std::uint32_t triangle = 0;
    std::int32_t patch = 0, group = 0;
    float largest = 0;  ///< nearness in the tile
  };

  void set_tile(const std::vector<PixelRay>& rays, ImageSize size, const Tile& tile);
  /// Triangles of VisibleTriangles.
  void draw(const PreparedScene& prepared, const SceneView& view, std::span<const std::uint32_t> triangles);

  const std::vector<Shape>& shapes() const { return shapes_; }
  /// One patch fills the tile, corners included, or the sky does.
  bool uniform() const { return uniform_; }
  /// Number of the shape at each place; kSky: none.
  const std::array<std::int32_t, kPlaces>& shape() const { return shape_; }
  const std::array<std::int32_t, kPlaces>& group() const { return group_; }
  /// Of the nearest place, 1 / m; 0: only sky.
  float largest_nearness() const { return largest_nearness_; }
  /// Directions of the places.
  const std::array<float, kPlaces>& x() const { return x_; }
  const std::array<float, kPlaces>& y() const { return y_; }

  struct Found {
    IntLanes shape;
    FloatLanes nearness;
  };
  /// At eight directions within the tile.
  Found find(FloatLanes x, FloatLanes y) const;

 private:
  void choose(const PreparedScene& prepared, const SceneView& view, std::span<const std::uint32_t> triangles);

  alignas(32) std::array<float, kPlaces> x_{}, y_{};
  alignas(32) std::array<std::int32_t, kPlaces> shape_{}, group_{};
  std::array<Eigen::Vector3f, 4> corners_;
  std::vector<Shape> shapes_;
  bool uniform_ = false;
  float largest_nearness_ = 0;
};

}  // namespace evpose::sim
