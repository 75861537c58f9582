// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event.h"

namespace evpose {

/// What there is to see, roughly, from events alone: each pixel sums its polarities and forgets them in a
/// fifth of a second. Behind an edge that has passed stands the sign of what it has brought.
class EventImage {
 public:
  explicit EventImage(ImageSize size)
      : size_(size), pixels_(static_cast<std::size_t>(size.width) * size.height) {}

  /// In order of time; events outside of the image are passed over.
  void add(const EventPacket& packet);
  /// Row by row; 0: nothing happened. `t`: that of the last event, or later.
  std::vector<float> at(TimeNs t) const;
  ImageSize size() const { return size_; }

 private:
  struct Pixel {
    float sum = 0;
    TimeNs t = 0;
  };
  ImageSize size_;
  std::vector<Pixel> pixels_;
};

}  // namespace evpose
