// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"

namespace evpose {

/// The part of the image that one contour sample answers for: a rectangle across the contour.
struct Strip {
  float x, y;    ///< centre, px
  float nx, ny;  ///< unit normal of the contour
  float reach;   ///< half width along the normal, px
};

/// Which strip each pixel belongs to. Among strips of one line the nearest along it, among those of several
/// lines the nearest across, or none when two are similarly near. Cost goes with the area of the strips and
/// not with that of the image: a claim carries the number of its call, so that nothing is ever cleared.
class StripMap {
 public:
  static constexpr std::size_t kMostStrips = 0xFFFF;

  /// `half_length_px`: of a strip, along the contour.
  StripMap(ImageSize size, double half_length_px, double ambiguity_px);

  /// Forgets all earlier strips. At most kMostStrips.
  void claim(std::span<const Strip> strips);

  /// Number of the strip that the pixel belongs to, -1: none. Pixel inside the image.
  std::int32_t owner(int x, int y) const {
    const std::uint32_t c = cells_[static_cast<std::size_t>(y) * static_cast<std::size_t>(size_.width) +
                                   static_cast<std::size_t>(x)];
    return (c & ~kStrip) == call_ ? static_cast<std::int32_t>(c & kStrip) : -1;
  }

  /// Number of pixels of each strip.
  std::span<const std::int32_t> claimed() const { return claimed_; }

 private:
  static constexpr std::uint32_t kStrip = 0xFFFF, kAmbiguous = 0x10000, kCallStep = 0x20000;
  void claim(std::uint32_t number, std::span<const Strip> strips);
  void contest(std::uint32_t& cell, std::uint32_t number, float x, float y, std::span<const Strip> strips);

  ImageSize size_;
  float half_length_, ambiguity_;
  std::uint32_t call_ = 0;  ///< in the bits above kAmbiguous; never 0 once something was claimed
  std::vector<std::uint32_t> cells_;
  std::vector<std::int32_t> claimed_;
  std::uint32_t neighbour_ = 0;  ///< strip that was last compared with the one being claimed ...
  bool same_line_ = false;       ///< ... and whether both are of one line
};

}  // namespace evpose
