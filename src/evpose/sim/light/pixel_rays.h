// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"

namespace evpose::sim {

/// Ray of a pixel, (x, y, 1) in the camera frame, and its derivative by column and row. The area of a pixel
/// is the parallelogram that the derivatives span. A lens that blurs has it `width` times as wide, so that
/// the areas of neighbours overlap; the derivatives are then as many times larger.
struct PixelRay {
  Eigen::Vector2f at, per_column, per_row;
  float width = 1;  ///< of the area, px

  Eigen::Vector3f direction() const { return {at.x(), at.y(), 1}; }
  /// `x`, `y` from the centre, in widths of the area: 1/2 is its rim.
  Eigen::Vector3f direction(float x, float y) const {
    return {at.x() + x * per_column.x() + y * per_row.x(), at.y() + x * per_column.y() + y * per_row.y(), 1};
  }
};

/// Row by row. `blur_px`: 1 sigma of the lens' point image along each axis. It adds its variance to that of
/// the pixel, as a wider box. Errors: a lens with a pixel beyond 89 degrees from the optical axis.
Expected<std::vector<PixelRay>> pixel_rays(const Camera& camera, double blur_px = 0);

/// Fraction of the area of a pixel where level + slope.x x + slope.y y > 0; x, y from -1/2 to 1/2.
float fraction_above(float level, Eigen::Vector2f slope);

}  // namespace evpose::sim
