// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose {
namespace {

using Colour = std::array<std::uint8_t, 3>;
constexpr Colour kOn{214, 56, 46}, kOff{38, 102, 214}, kMatched{0, 150, 60}, kUnmatched{175, 175, 175};

void blend(std::uint8_t* pixel, const Colour& ink, float share) {
  for (std::size_t c = 0; c < 3; ++c) {
    const float mixed = (1 - share) * static_cast<float>(pixel[c]) + share * static_cast<float>(ink[c]);
    pixel[c] = static_cast<std::uint8_t>(std::lround(mixed));
  }
}

/// A cross for a matched point, a dot for another.
void draw_point(RgbImage* image, const OverlayPoint& point) {
  // Written so that NaN fails as well.
  if (!(point.x > -0.5f && point.y > -0.5f && point.x < static_cast<float>(image->width) - 0.5f &&
        point.y < static_cast<float>(image->height) - 0.5f))
    return;
  const int x = static_cast<int>(std::lround(point.x)), y = static_cast<int>(std::lround(point.y));
  if (!point.matched) return blend(image->pixel(x, y), kUnmatched, 1);
  constexpr int kArms[5][2] = {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  for (const auto& [dx, dy] : kArms) {
    const int u = x + dx, v = y + dy;
    if (u < 0 || v < 0 || u >= image->width || v >= image->height) continue;
    blend(image->pixel(u, v), kMatched, dx == 0 && dy == 0 ? 1.0f : 0.75f);
  }
}

}  // namespace

RgbImage draw_overlay(int width, int height, std::span<const float> decay,
                      std::span<const OverlayPoint> points) {
  RgbImage image(width, height);
  EVPOSE_CHECK(3 * decay.size() == image.rgb.size());
  for (std::size_t i = 0; i < decay.size(); ++i) {
    if (!(decay[i] != 0)) continue;
    blend(&image.rgb[3 * i], decay[i] > 0 ? kOn : kOff, std::min(1.0f, std::abs(decay[i])));
  }
  for (const bool matched : {false, true})  // matched ones on top
    for (const OverlayPoint& p : points)
      if (p.matched == matched) draw_point(&image, p);
  return image;
}

}  // namespace evpose
