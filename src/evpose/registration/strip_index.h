// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"

namespace evpose {

/// The part of the image that one contour sample answers for: a rectangle across the contour that moves with
/// it. An event at e of age a has the signed distance n.(e - x) + speed a - curvature a^2 from the contour.
struct Strip {
  float x, y;              ///< centre at the time of the update, px
  float nx, ny;            ///< unit normal of the contour
  float speed, curvature;  ///< px/us, px/us^2
  float reach;             ///< largest distance, px
};

/// Finds the strip that an event belongs to, at the event's own time. Among strips of one line that is the
/// nearest along it; among those of several lines the nearest across, or none when two are similarly near.
/// Built anew for each update, as strips move; the cost goes with strips and events, not with the image.
class StripIndex {
 public:
  /// `half_length_px`: of a strip, along the contour.
  StripIndex(ImageSize size, double half_length_px, double ambiguity_px);

  /// Forgets all earlier strips. `span_us`: age of the oldest event that will be asked for.
  void build(std::span<const Strip> strips, float span_us);

  struct Owner {
    std::int32_t strip = -1;  ///< -1: none
    float distance = 0;       ///< signed, px
  };
  /// Position inside the image.
  Owner find(float x, float y, float age_us) const {
    std::int32_t k = heads_[static_cast<std::size_t>(static_cast<int>(y) / kCell_px * columns_ +
                                                     static_cast<int>(x) / kCell_px)];
    Owner nearest;
    Hit hits[kMostHits];
    int n = 0;
    for (; k >= 0; k = entries_[static_cast<std::size_t>(k)].next) {
      const std::int32_t number = entries_[static_cast<std::size_t>(k)].strip;
      const Strip& s = strips_[static_cast<std::size_t>(number)];
      const float dx = x - s.x, dy = y - s.y, along = std::abs(s.nx * dy - s.ny * dx);
      const float d = s.nx * dx + s.ny * dy + (s.speed - s.curvature * age_us) * age_us;
      if (along > half_length_ || std::abs(d) > s.reach) continue;
      if (n == kMostHits) return {};
      if (n == 0 || std::abs(d) < std::abs(nearest.distance)) nearest = {number, d};
      hits[n++] = {number, d, along};
    }
    return n < 2 ? nearest : settle(nearest, {hits, static_cast<std::size_t>(n)});
  }

 private:
  static constexpr int kCell_px = 8, kMostHits = 16;  // more than so many strips at one place are a tangle
  struct Hit {
    std::int32_t strip;
    float distance, along;
  };
  struct Entry {
    std::int32_t strip, next;
  };
  Owner settle(const Owner& nearest, std::span<const Hit> hits) const;
  void enter(std::int32_t number, float span_us);

  int columns_, rows_;
  float half_length_, ambiguity_;
  std::vector<Strip> strips_;
  std::vector<Entry> entries_;
  std::vector<std::int32_t> heads_;  ///< of each cell's list of entries, -1: none
};

}  // namespace evpose
