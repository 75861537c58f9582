// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>

#include "evpose/core/time.h"
#include "evpose/sim/light/tile_sampler.h"

namespace evpose::sim {

/// Two samples of a tile and what is needed to evaluate luminance between them.
struct CurveContext {
  const PreparedScene& prepared;
  const TileSampler& sampler;
  const SceneView &from, &to;
  TimeNs t0, t1;
  mutable std::array<std::optional<SceneView>, 3> quarters{};  ///< made at the first request

  /// View at one, two or three quarters of the interval.
  const SceneView& at_quarter(int k) const {
    auto& view = quarters[k - 1];
    if (!view) view = interpolate_view(from, to, 0.25 * k);
    return *view;
  }
};

/// Luminance of a pixel between two samples, linear between knots. Times are fractions of the interval.
struct LuminanceCurve {
  static constexpr int kMostKnots = 11;
  int knots = 0;  ///< 2 at least
  std::array<float, kMostKnots> time{}, luminance{};

  void add(float at, float value) {
    time[knots] = at;
    luminance[knots++] = value;
  }
  /// Integral from fraction `open` to fraction `close` of the interval.
  float integral(double open, double close) const;
};

/// True if luminance between the samples may be taken as linear.
inline bool nearly_equal(const PixelSample& p, const PixelSample& q) {
  constexpr float kLargestRatio = 1.08F;
  return p.luminance <= kLargestRatio * q.luminance && q.luminance <= kLargestRatio * p.luminance;
}

/// `p` and `q` are the samples of pixel (x, y) of the tile at the two ends. Small changes are taken as
/// linear. A border that crosses the pixel moves along its line; a texture is sampled again in between.
LuminanceCurve luminance_curve(const CurveContext& context, const PixelSample& p, const PixelSample& q,
                               const TilePlan& plan, int x, int y);

}  // namespace evpose::sim
