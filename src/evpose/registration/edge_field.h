// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// Standard deviation of edges about contours: wide while the pose is poorly known, narrow once it is
/// refined.
enum class EdgeSpread : std::uint8_t { coarse, fine };

/// Distance of each pixel to the nearest edge of a given direction: one distance transform for each of eight
/// directions. It is built from a slice of events so short that contours hardly move in it. Unlike the time
/// surface it reaches tens of pixels, so that a pose far from the predicted one can be found.
class EdgeField {
 public:
  static constexpr int kDirections = 8;
  static constexpr float kReach_px = 40;  ///< distances are cut off here

  explicit EdgeField(ImageSize size);

  /// Events in any order; those whose neighbours do not form a line are left out.
  void build(std::span<const FilteredEvent> events);

  /// Direction bin of a line along (x, y).
  static int direction(double x, double y);

  struct Sample {
    float distance, dx, dy;  ///< px, and its gradient
  };
  /// Interpolated at a pixel at least one pixel inside the image.
  Sample sample(double x, double y, int direction) const;

  /// Likelihood ratio of the distance at this pixel: a contour's edge (a normal distribution of this spread)
  /// against the background.
  float likelihood_ratio(double x, double y, int direction, EdgeSpread spread) const;
  /// Mean likelihood of an edge of this direction in the neighbourhood of this pixel, 0 to 1: high in
  /// texture, where an edge is near at any pose.
  float background(double x, double y, int direction, EdgeSpread spread) const;
  static float spread_px(EdgeSpread spread);

 private:
  using Plane = std::vector<float>;
  float at(int column, int row, int direction) const {
    return planes_[static_cast<std::size_t>(direction)]
                  [static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)];
  }
  /// Sets the distance to zero in the directions of this cell's line, if its neighbours form one.
  void mark_edge(int column, int row);
  void transform_distances(Plane& plane) const;
  void average_background(EdgeSpread spread);
  Plane sum_blocks(int direction, EdgeSpread spread) const;

  ImageSize size_;
  int cell_;  ///< pixels of the image to one of the field, along each axis
  int columns_, rows_, block_columns_, block_rows_;
  std::vector<std::uint8_t> active_;
  std::array<Plane, kDirections> planes_;
  std::array<std::array<Plane, kDirections>, 2> background_;  ///< per spread, direction and block
};

}  // namespace evpose
