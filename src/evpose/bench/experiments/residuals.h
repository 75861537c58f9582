// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/bench/experiments/contour_looks.h"
#include "evpose/bench/experiments/recordings.h"

namespace evpose::experiments {

struct ResidualsRequest {
  BenchRecording recording;
  std::string picture;                   ///< SVG file to write; empty: none
  std::vector<std::string> assignments;  ///< settings of the tracker
};

/// Where events lie beside the contours of the true pose, as the measurement model has them and as they are:
/// tables by contrast, polarity, speed, distance and direction, and how long an offset lasts, by direction
/// too. What is left over with the pose of the tracker stands beside it.
Status print_residuals(const ResidualsRequest& request);

/// Correlation of what is left over in two looks at one segment, by the time between them.
struct LookCorrelation {
  double least_s, most_s;
  int pairs = 0;
  double correlation = 0;  ///< of the offsets without the noise of single looks
};
std::vector<LookCorrelation> correlation_over_time(const std::vector<ContourLook>& looks);

/// Correlations as share * exp(-time / time_s), by least squares over those with 30 pairs or more.
struct LookMemory {
  double share = 0;   ///< of the variance, that lasts at all
  double time_s = 0;  ///< up to 10; what is longer than looks are apart, is told by their fall alone
};
LookMemory memory_of(const std::vector<LookCorrelation>& correlations);

/// Mean over looks, and their scatter about it beyond the noise of single looks.
struct LookScatter {
  int looks = 0;
  double mean_px = 0, sigma_px = 0;
};
/// `value`: of a look, px; its noise is the look's.
template <class Value>
LookScatter scatter_of(const std::vector<const ContourLook*>& looks, const Value& value) {
  LookScatter out;
  out.looks = static_cast<int>(looks.size());
  double noise = 0, square = 0;
  for (const ContourLook* look : looks) {
    out.mean_px += value(*look);
    square += value(*look) * value(*look);
    noise += look->variance_px2();
  }
  const double n = std::max(1, out.looks);
  out.mean_px /= n;
  out.sigma_px = std::sqrt(std::max(0.0, square / n - out.mean_px * out.mean_px - noise / n));
  return out;
}

}  // namespace evpose::experiments
