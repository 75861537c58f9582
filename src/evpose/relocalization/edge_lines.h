// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// A straight edge in the image.
struct EdgeLine {
  Eigen::Vector2d from, to;  ///< px
};

/// Straight edges in a slice of events, dotted ones among them: a pixel with many others of its polarity on
/// one line through it grows along this line.
class EdgeLineFinder {
 public:
  explicit EdgeLineFinder(ImageSize size);

  /// Events in any order. The lines come in a fixed order, whatever that of the events.
  std::vector<EdgeLine> find(std::span<const FilteredEvent> events);

 private:
  struct Seed {
    int column, row;
    std::uint16_t direction;
    float significance;  ///< of its line, standard deviations of chance
  };
  /// Where to look around a seed, and which directions that speaks for.
  struct Offset {
    int column, row;
    std::uint32_t directions;  ///< a bit for each
  };
  void find_seeds();
  void grow(const Seed& seed, std::vector<EdgeLine>& lines);
  bool active(int column, int row) const {
    return column >= 0 && row >= 0 && column < columns_ && row < rows_ &&
           active_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)] != 0;
  }

  int cell_px_;
  int columns_, rows_;
  std::vector<Offset> offsets_;
  std::vector<float> shares_;         ///< of the offsets, by direction
  std::vector<std::uint8_t> active_;  ///< 1: events, 2: on a line that was found
  std::vector<Seed> seeds_;
  std::vector<Eigen::Vector2d> members_;  ///< of the line that grows
};

}  // namespace evpose
