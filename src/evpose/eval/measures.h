// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "evpose/eval/score.h"

namespace evpose {

// The single figures of a TrajectoryScore. Samples in order of time, stamps distinct.

struct Coverage {
  double share = 0;  ///< 0..1
  std::vector<Stretch> lost;
};
/// Share of the instants from, from + 10 ms, ... below `to` within 20 ms of a sample. Samples inside [from,
/// to].
Coverage coverage_of(std::span<const ErrorSample> samples, TimeNs from, TimeNs to);

/// Each sample against the one nearest to `span` later, if it is within 0.3 of the span.
std::optional<RelativeError> relative_over_time(std::span<const ErrorSample> samples, TimeNs span);

/// Each sample against the first at least `length_m` of true path later.
std::optional<RelativeError> relative_over_path(std::span<const ErrorSample> samples, double length_m);

struct Lag {
  double lag_ms = 0;  ///< > 0: the estimate is behind
  std::optional<double> standard_error_ms;
};
/// Regression of the position error on the true velocity. The standard error takes sums over half a second as
/// independent, since errors persist for many samples. Absent without motion.
std::optional<Lag> lag_of(std::span<const ErrorSample> samples);

/// RMS of (consecutive estimated motion - true motion), mm. Consecutive: neighbours in the estimate.
std::optional<double> jitter(std::span<const ErrorSample> samples);

/// Mean of the position error along the true motion, in pixels. `pixels_per_metre` by ErrorSample::index.
std::optional<double> along_motion(std::span<const ErrorSample> samples,
                                   std::span<const double> pixels_per_metre);

struct Consistency {
  double mean = 0;  ///< NEES / 6
  double share_in_band =
      0;  ///< of single values inside the central 95 % of chi-square with 6 degrees of freedom
  DirectionNees by_direction;
};
/// `covariances` of the poses before alignment, by ErrorSample::index; what is not positive definite is left
/// out.
std::optional<Consistency> consistency(std::span<const ErrorSample> samples,
                                       std::span<const Matrix6d> covariances, const Similarity& alignment);

}  // namespace evpose
