// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contrast_memory.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr double kDoubt_px2 = 20;  // of a step of none, before anything is seen

}  // namespace

void describe(ConfigTable& table, ContrastConfig& c) {
  table.add("threshold", c.threshold, "", "contrast of the log luminance that makes an event", {0.01, 2});
  table.add("lateness_px", c.lateness_px, "px", "events come at least so much after the contour", {-1, 1});
  table.add("threshold_px", c.threshold_px, "px",
            "... and by this, divided by the steps of the threshold, more", {0, 1});
  table.add("latest_px", c.latest_px, "px", "... but not by more than this", {0, 2});
  table.add("unknown_lateness_px", c.unknown_lateness_px, "px", "lateness of contours not known yet",
            {-1, 1});
  table.add("memory_px2", c.memory_px2, "px^2", "area swept until what was learnt counts half", {50, 1e9});
}

ContrastMemory::ContrastMemory(std::uint32_t pieces, const ContrastConfig& config)
    : config_(config), pieces_(pieces) {}

void ContrastMemory::sweep(std::uint32_t piece, double area_px2) {
  Piece& p = pieces_[piece];
  p.swept_px2 += static_cast<float>(area_px2);
  if (p.swept_px2 > config_.memory_px2) p.swept_px2 *= 0.5F, p.net *= 0.5F;
}

void ContrastMemory::count(std::uint32_t piece, int sign) { pieces_[piece].net += static_cast<float>(sign); }

double ContrastMemory::steps(std::uint32_t piece) const {
  const Piece& p = pieces_[piece];
  return p.net / (p.swept_px2 + kDoubt_px2);
}

ContrastMemory::Lateness ContrastMemory::lateness(std::uint32_t piece) const {
  const double n = std::abs(steps(piece));
  const double late = known(piece) ? std::min(config_.latest_px,
                                              config_.lateness_px + config_.threshold_px / std::max(n, 1e-3))
                                   : config_.unknown_lateness_px;
  // Where the logarithm is halfway between both sides, of a pixel's width; s: square root of their ratio.
  const double s = std::exp(0.5 * n * config_.threshold);
  const double towards_dark = 0.5 - 1 / (1 + s);
  return {late - towards_dark, late + towards_dark};
}

}  // namespace evpose
