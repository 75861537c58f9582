// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>

#include "evpose/core/time.h"
#include "evpose/sim/light/tile_sampler.h"

namespace evpose::sim {

/// Two samples of a tile and what is needed to look between them.
struct CourseContext {
  const Stage& stage;
  const TileSampler& sampler;
  const View &from, &to;
  TimeNs t0, t1;
  mutable std::array<std::optional<View>, 3> quarters{};  ///< made when first asked for

  /// View at a quarter, half or three quarters of the way.
  const View& at_quarter(int k) const {
    auto& view = quarters[k - 1];
    if (!view) view = between(from, to, 0.25 * k);
    return *view;
  }
};

/// Luminance of a pixel between two samples, linear between knots. Times are shares of the way.
struct Course {
  static constexpr int kMostKnots = 11;
  int knots = 0;  ///< 2 at least
  std::array<float, kMostKnots> time{}, luminance{};

  void add(float at, float value) {
    time[knots] = at;
    luminance[knots++] = value;
  }
  /// Mean from share `open` to share `close`, times their difference.
  float integral(double open, double close) const;
};

/// True where a straight line is good enough.
inline bool nearly_same(const PixelSample& p, const PixelSample& q) {
  constexpr float kSmall = 1.08F;
  return p.luminance <= kSmall * q.luminance && q.luminance <= kSmall * p.luminance;
}

/// `p` and `q` are the samples of pixel (x, y) of the tile at the two ends. Small changes are taken as
/// linear. A border that crosses the pixel is followed along its line; a texture is looked at again.
Course pixel_course(const CourseContext& context, const PixelSample& p, const PixelSample& q,
                    const TilePlan& plan, int x, int y);

}  // namespace evpose::sim
