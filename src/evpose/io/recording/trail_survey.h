// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event.h"

namespace evpose {

/// Whether a trail filter has been at a stream that keeps one event of each trail (TrailFilterKind first or
/// second): then no two successive events of a pixel are of one polarity and close to each other, though
/// events of opposite polarity are. One that keeps all but the first leaves no such mark.
class TrailSurvey {
 public:
  /// Events outside of the size are not looked at.
  explicit TrailSurvey(ImageSize size);
  void add(const EventPacket& packet);
  /// A gap below which pairs of one polarity are missing, s; none: there are some, or too few to tell.
  std::optional<double> filtered_gap_s() const;

 private:
  static constexpr std::array<TimeNs, 6> kGaps{kNsPerMs / 2, kNsPerMs,     2 * kNsPerMs,
                                               4 * kNsPerMs, 8 * kNsPerMs, 16 * kNsPerMs};
  struct Pixel {
    TimeNs last = 0;
    std::int8_t sign = 0;  ///< 0: no event yet
  };
  ImageSize size_;
  std::vector<Pixel> pixels_;
  std::array<std::int64_t, kGaps.size()> same_{}, opposite_{};  ///< pairs that are closer
};

}  // namespace evpose
