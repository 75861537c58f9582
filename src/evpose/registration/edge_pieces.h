// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// A short straight piece of an edge in the image, as the events of some milliseconds show it.
struct EdgePiece {
  Eigen::Vector2d pixel;   ///< on it, at the mean time of its events
  Eigen::Vector2d normal;  ///< unit, across it
  double age_s;            ///< of that time
  double sigma_px;         ///< of the pixel, along the normal
};

/// Finds pieces of edges: events of one polarity that lie on a line within a few pixels.
class EdgePieceFinder {
 public:
  explicit EdgePieceFinder(ImageSize size);

  /// At most one piece for each block of 12 x 12 pixels, and 500 in all, the clearest. Events in any order,
  /// at most a quarter of a second old at `now_us`.
  std::vector<EdgePiece> find(std::span<const FilteredEvent> events, std::uint32_t now_us);

 private:
  struct Scored {
    double score = 0;
    EdgePiece piece{};
  };
  Scored piece_at(const FilteredEvent& event) const;
  std::size_t pixel_of(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(size_.width) + static_cast<std::size_t>(x);
  }

  ImageSize size_;
  std::array<std::vector<std::uint16_t>, 2> age_;   ///< of each pixel's newest event, by polarity; 0: none
  std::vector<std::vector<std::uint32_t>> blocks_;  ///< numbers of the events in the middle of each block
};

}  // namespace evpose
