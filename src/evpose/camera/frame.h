// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/time.h"

namespace evpose {

/// How a camera's frames come about.
struct FrameCamera {
  double gamma = 2.2;     ///< grey value ~ luminance^(1 / gamma); 1 for a linear sensor
  double row_time_s = 0;  ///< from the exposure of one row to that of the next; 0: global shutter
};

/// A grey-level picture through the pixels of the event camera.
struct Frame {
  TimeNs t = 0;         ///< middle of the exposure, of the middle row; on the clock of the events
  TimeNs exposure = 0;  ///< 0: not known, taken for short
  ImageSize size;
  std::vector<std::uint8_t> grey;  ///< row by row

  /// When the last row is exposed.
  TimeNs end(const FrameCamera& camera) const {
    return t + exposure / 2 + from_seconds(0.5 * size.height * std::abs(camera.row_time_s));
  }
};

}  // namespace evpose
