// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose {
namespace {

using Colour = std::array<std::uint8_t, 3>;
constexpr Colour kOn{214, 56, 46}, kOff{38, 102, 214};
constexpr Colour kMatched{0, 150, 60}, kArm{64, 176, 109}, kUnmatched{175, 175, 175};
constexpr float kShades = 15;  // few enough for a palette, which halves the picture's file

void blend(std::uint8_t* pixel, const Colour& ink, float share) {
  for (std::size_t c = 0; c < 3; ++c) {
    const float mixed = (1 - share) * static_cast<float>(pixel[c]) + share * static_cast<float>(ink[c]);
    pixel[c] = static_cast<std::uint8_t>(std::lround(mixed));
  }
}

void put(std::uint8_t* pixel, const Colour& ink) { std::copy(ink.begin(), ink.end(), pixel); }

/// A cross for a matched point, a dot for another.
void draw_point(RgbImage* image, const OverlayPoint& point) {
  // Written so that NaN fails as well.
  if (!(point.x > -0.5f && point.y > -0.5f && point.x < static_cast<float>(image->width) - 0.5f &&
        point.y < static_cast<float>(image->height) - 0.5f))
    return;
  const int x = static_cast<int>(std::lround(point.x)), y = static_cast<int>(std::lround(point.y));
  if (!point.matched) return put(image->pixel(x, y), kUnmatched);
  constexpr int kArms[5][2] = {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  for (const auto& [dx, dy] : kArms) {
    const int u = x + dx, v = y + dy;
    if (u < 0 || v < 0 || u >= image->width || v >= image->height) continue;
    put(image->pixel(u, v), dx == 0 && dy == 0 ? kMatched : kArm);
  }
}

}  // namespace

RgbImage draw_overlay(int width, int height, std::span<const float> decay,
                      std::span<const OverlayPoint> points) {
  RgbImage image(width, height);
  EVPOSE_CHECK(3 * decay.size() == image.rgb.size());
  for (std::size_t i = 0; i < decay.size(); ++i) {
    if (!(decay[i] != 0)) continue;
    const float share = std::round(kShades * std::min(1.0f, std::abs(decay[i]))) / kShades;
    blend(&image.rgb[3 * i], decay[i] > 0 ? kOn : kOff, share);
  }
  for (const bool matched : {false, true})  // matched ones on top
    for (const OverlayPoint& p : points)
      if (p.matched == matched) draw_point(&image, p);
  return image;
}

}  // namespace evpose
