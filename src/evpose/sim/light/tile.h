// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "evpose/sim/light/pixel_rays.h"

namespace evpose::sim {

inline constexpr int kTilePx = 16;
inline constexpr int kTilePixels = kTilePx * kTilePx;  ///< row by row, kTilePx apart

/// A square of the image.
struct Tile {
  int x0 = 0, y0 = 0, width = 0, height = 0;  ///< up to kTilePx each way

  /// Directions (x, y, 1) of its corners, moved outwards by `margin_px`.
  std::array<Eigen::Vector3f, 4> corners(const std::vector<PixelRay>& rays, ImageSize size,
                                         float margin_px) const {
    const float far = 0.5F + margin_px;
    const auto ray = [&](int x, int y, float dx, float dy) {
      return rays[static_cast<std::size_t>(y0 + y) * size.width + x0 + x].direction(dx, dy);
    };
    return {ray(0, 0, -far, -far), ray(width - 1, 0, far, -far), ray(0, height - 1, -far, far),
            ray(width - 1, height - 1, far, far)};
  }
};

}  // namespace evpose::sim
