// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/time.h"

namespace evpose::experiments {

/// Corners of the surface of active events (Alzugaray and Chli, "Asynchronous Corner Detection and Tracking
/// for Event Cameras in Real Time", 2018: Arc*). An event is one if on both circles around it, of 3 and 4 px,
/// the newest arc of its polarity, or what that arc leaves, is as long as an angle's and not as a line's.
class ArcCorners {
 public:
  explicit ArcCorners(ImageSize size);

  /// Of events in the order of their times; `x`, `y` inside the image. No corner within 4 px of its border,
  /// nor where the same polarity came within 50 ms before: the rest of a burst.
  bool is_corner(TimeNs t, int x, int y, bool on);

 private:
  ImageSize size_;
  std::array<std::vector<TimeNs>, 2> begun_, last_;  ///< of each pixel's last burst, by polarity
};

/// Whether the newest arc of a circle is a corner's: of `shortest` to `longest` pixels, or all but so many.
/// `times` of the circle's pixels, one beside the next.
bool has_corner_arc(const std::vector<TimeNs>& times, int shortest, int longest);

}  // namespace evpose::experiments
