// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/light/prepared_scene.h"
#include "evpose/sim/light/scene_view.h"
#include "evpose/sim/light/tile.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::sim {

/// For each tile of the image the static triangles that it may show while the camera moves by a few pixels.
class VisibleTriangles {
 public:
  /// Keeps references.
  VisibleTriangles(const PreparedScene& prepared, const std::vector<PixelRay>& rays, ImageSize size,
                   std::vector<Tile> tiles);

  /// Between the two views. A triangle is left out where it lies outside of the tile in both views, by one
  /// and the same of its edges, or behind a triangle that covers the whole tile in both.
  void find(const SceneView& from, const SceneView& to, ThreadPool& pool);

  /// Nearest first.
  std::span<const std::uint32_t> of_tile(std::size_t tile) const { return found_[tile]; }
  const std::vector<Tile>& tiles() const { return tiles_; }

 private:
  struct Range {
    float low, high;
  };
  struct Candidate;
  struct Placed {
    std::uint32_t triangle;
    float nearness;  ///< the largest in the tile, 1 / m
  };
  void collect(const SceneView& from, const SceneView& to, std::size_t begin, std::size_t end,
               std::vector<Candidate>& out) const;
  void fill_row(const std::vector<std::vector<Candidate>>& candidates, int row);

  const PreparedScene& prepared_;
  std::vector<Tile> tiles_;
  int columns_ = 0, rows_ = 0;
  std::vector<std::array<Eigen::Vector3f, 4>> corners_;  ///< of each tile
  std::vector<Range> column_range_, row_range_;          ///< of the directions of a column or row of tiles
  std::vector<std::vector<std::uint32_t>> found_;
};

}  // namespace evpose::sim
