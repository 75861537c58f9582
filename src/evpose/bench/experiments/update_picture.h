// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

/// Part of an image, px.
struct PictureCrop {
  double x = 0, y = 0, width = 0, height = 0;

  bool holds(double px, double py) const { return px >= x && py >= y && px < x + width && py < y + height; }
};

struct UpdatePictureRequest {
  BenchRecording recording;
  std::string output;  ///< SVG file
  double at_s = 1;     ///< of the run
  std::optional<PictureCrop> crop;
};

/// Draws the first update at that time or after: its events, what the alignment made of each, and the
/// contours that they were held against.
Status draw_update(const UpdatePictureRequest& request);

}  // namespace evpose::experiments
