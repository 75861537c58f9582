// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

namespace evpose {

/// How far behind a contour its events lie on average, px along the contour's motion, by polarity. A pixel
/// sees the brightness step as its share of it, linear over its width, and triggers by the logarithm:
///  - A logarithm is halfway when most of the pixel is still dark, so that brightening (on) is early and
///    darkening (off) late.
///  - Before, texture has moved the pixel's brightness to and fro since its last event: the distance to the
///    next one is a random walk's between two walls that set it back to the middle, so all values occur with
///    the odds of a triangle over twice the threshold. Added over the first, second, ... event, the density
///    of events over the rise grows over the first threshold from nothing to one per threshold, and stays.
struct EdgeDelay {
  double on_px = 0, off_px = 0;
};

/// Events that a pixel is expected to make at a step of n thresholds of log luminance, n >= 0; and the step
/// of which so many are expected.
double expected_events(double thresholds);
double step_of_events(double events);

/// `thresholds`: of the step, >= 0; `threshold`: of the camera, in log luminance.
EdgeDelay edge_delay(double thresholds, double threshold);

/// The same by a table of steps up to kMost thresholds, linear in between: good to 0.001 px.
class EdgeDelayTable {
 public:
  explicit EdgeDelayTable(double threshold);
  EdgeDelay operator()(double thresholds) const;

 private:
  static constexpr int kPerThreshold = 16, kMost = 12;
  double threshold_;
  std::array<EdgeDelay, kPerThreshold * kMost + 1> values_;
};

}  // namespace evpose
