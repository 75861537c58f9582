// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_front.h"

namespace evpose {

/// How far each pixel is from the next edge of a given direction, in a slice of events short enough that
/// contours stand still in it: a distance transform for each of eight directions. Unlike the time surface it
/// reaches tens of pixels, so that a pose can be found that is nowhere near the predicted one.
class EdgeField {
 public:
  static constexpr int kDirections = 8;
  static constexpr float kReach_px = 40;  ///< distances are cut off here

  explicit EdgeField(ImageSize size);

  /// Events in any order; those whose neighbours lie on no line are left out.
  void build(std::span<const FrontEvent> events);

  /// Direction number of a line along (x, y).
  static int direction(double x, double y);

  struct Sample {
    float distance, dx, dy;  ///< px; its gradient
  };
  /// Pixel at least one pixel inside the image.
  Sample sample(double x, double y, int direction) const;

  /// Probability density ratio, edge against chance, of the distance at this pixel: `sigma_px` is the spread
  /// of edges about contours; chance is how often such a distance occurs around this place. One of the two
  /// spreads given to set_spreads, by number.
  float odds(double x, double y, int direction, int spread) const;
  /// How often an edge of this direction is as near as the spread around this place.
  float chance(double x, double y, int direction, int spread) const;
  void set_spreads(float coarse_px, float fine_px);
  float spread_px(int spread) const { return spreads_[static_cast<std::size_t>(spread)]; }

  /// Pixels with an edge of some direction.
  int edges() const { return edges_; }

 private:
  using Plane = std::vector<float>;
  float at(int column, int row, int direction) const {
    return planes_[static_cast<std::size_t>(direction)]
                  [static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)];
  }
  void transform(Plane& plane) const;
  void count_chance();

  ImageSize size_;
  int cell_;  ///< pixels of the image to one of the field
  int columns_, rows_, block_columns_, block_rows_;
  int edges_ = 0;
  std::vector<std::uint8_t> active_;
  std::array<Plane, kDirections> planes_;
  std::array<float, 2> spreads_{6, 2};
  std::array<std::array<Plane, kDirections>, 2> chance_;  ///< per spread, direction and block
};

}  // namespace evpose
