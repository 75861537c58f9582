// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "evpose/sim/light/tile_samples.h"

namespace evpose::sim {

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

/// Largest ratio of two samples between which luminance may be taken as linear.
inline constexpr float kLinearRatio = 1.08F;
inline bool nearly_equal(float p, float q) { return p <= kLinearRatio * q && q <= kLinearRatio * p; }

/// Samples of a texture wanted between two that differ so much: 0, 1 or 3, evenly spaced.
int texture_samples_between(float p, float q);

/// True if the border between two groups is known.
inline bool has_border(const PixelSample& s) { return s.border.other != kNone && s.border.other != kMany; }

/// The curve between samples `p` and `q`, seen in the views `from` and `to`, one of which has a border: it
/// moves along its line. The curve is a straight line where the border does not explain both samples.
LuminanceCurve border_curve(const PreparedScene& prepared, const SceneView& from, const SceneView& to,
                            const PixelRay& ray, const PixelSample& p, const PixelSample& q);

}  // namespace evpose::sim
