// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "evpose/io/files/png_file.h"

namespace evpose {

/// A map point in the image.
struct OverlayPoint {
  float x = 0, y = 0;    ///< px; outside the image it is not drawn
  bool matched = false;  ///< with events near by
};

/// The map over the time surface, on white: events red (on) and blue (off), matched points green, others
/// grey. `decay`: row-major, one value per pixel, from -1 (an off event just now) through 0 (none) to 1 (an
/// on event).
RgbImage draw_overlay(int width, int height, std::span<const float> decay,
                      std::span<const OverlayPoint> points);

}  // namespace evpose
