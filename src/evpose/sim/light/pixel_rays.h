// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"

namespace evpose::sim {

/// What a pixel looks along: (x, y, 1) in the camera frame, and its change from pixel to pixel. A pixel's
/// area is taken as the parallelogram that these span.
struct PixelRay {
  Eigen::Vector2f at, per_column, per_row;

  Eigen::Vector3f direction() const { return {at.x(), at.y(), 1}; }
  /// `x`, `y` in pixels from the centre.
  Eigen::Vector3f direction(float x, float y) const {
    return {at.x() + x * per_column.x() + y * per_row.x(), at.y() + x * per_column.y() + y * per_row.y(), 1};
  }
};

/// Row by row. Errors: a lens that looks beyond 89 degrees from its axis at some pixel.
Expected<std::vector<PixelRay>> pixel_rays(const Camera& camera);

/// Share of a pixel's area where level + slope.x x + slope.y y > 0; x, y from -1/2 to 1/2.
float share_above(float level, Eigen::Vector2f slope);

}  // namespace evpose::sim
