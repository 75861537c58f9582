// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contrast_memory.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kDoubt_px2 = 20;  // of a step of none, or of the map's sign, before anything is seen
constexpr double kSeedSteps = 1;   // of the threshold, that a map's sign stands for

// Law of the edge delay, as measured in simulated flights: by contrast in steps n of the threshold,
// min(largest, least + by_contrast / n).
constexpr double kLeastDelay_px = 0.06;
constexpr double kDelayByContrast_px = 0.04;
constexpr double kLargestDelay_px = 0.16;

}  // namespace

ContrastMemory::ContrastMemory(std::uint32_t segments, double threshold)
    : threshold_(threshold), segments_(segments) {}

void ContrastMemory::seed(std::uint32_t segment, int sign) {
  if (sign == 0) return;
  segments_[segment].net += static_cast<float>(sign * kSeedSteps * kDoubt_px2);
  segments_[segment].seeded = true;
}

void ContrastMemory::sweep(std::uint32_t segment, double area_px2) {
  Segment& s = segments_[segment];
  s.swept_px2 += static_cast<float>(area_px2);
  if (s.swept_px2 > kMemory_px2) s.swept_px2 *= 0.5F, s.net *= 0.5F;
}

void ContrastMemory::count(std::uint32_t segment, int net) {
  segments_[segment].net += static_cast<float>(net);
}

int ContrastMemory::map_contrast(std::uint32_t segment) const {
  const double n = steps(segment);
  if (!known(segment) || std::abs(n) < kSureSteps) return 0;
  return n > 0 ? -1 : 1;
}

double ContrastMemory::steps(std::uint32_t segment) const {
  const Segment& s = segments_[segment];
  return s.net / (s.swept_px2 + kDoubt_px2);
}

ContrastMemory::EdgeDelay ContrastMemory::edge_delay(std::uint32_t segment) const {
  const double n = std::abs(steps(segment));
  const double delay =
      measured(segment) ? std::min(kLargestDelay_px, kLeastDelay_px + kDelayByContrast_px / std::max(n, 1e-3))
                        : kUnknownDelay_px;
  // Where the logarithm is halfway between both sides, of a pixel's width; s: square root of their ratio.
  const double s = std::exp(0.5 * n * threshold_);
  const double towards_dark = 0.5 - 1 / (1 + s);
  return {delay - towards_dark, delay + towards_dark};
}

}  // namespace evpose
