// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contrast_memory.h"

#include <algorithm>
#include <cmath>

#include "evpose/registration/rearranged.h"

namespace evpose {
namespace {

constexpr double kDoubt_px2 = 20;     // of a step of none, or of the map's sign, before anything is seen
constexpr float kGateMemory = 100;    // events in the gates until those before count half
constexpr float kGateFlow_px = 1000;  // likewise, way of the image
// So many of the contour, and as much clutter, on such a way before any have come.
constexpr double kGateDoubt = 10, kGateDoubt_px = 4;
constexpr double kLeastShare = 0.02;  // of the contour, and of clutter
constexpr double kSeedSteps = 1;      // of the threshold, that a map's sign stands for

}  // namespace

ContrastMemory::ContrastMemory(std::uint32_t segments, double threshold, const TrailFilterSetting& filter)
    : delays_(threshold), segments_(segments) {
  if (filter.kind != TrailFilterKind::none) filtered_delays_.emplace(filter, threshold);
}

void ContrastMemory::seed(std::uint32_t segment, int sign) {
  if (sign == 0) return;
  segments_[segment].net += static_cast<float>(sign * kSeedSteps * kDoubt_px2);
  segments_[segment].seeded = true;
}

void ContrastMemory::rearrange(std::span<const std::uint32_t> before, std::span<const int> map_contrast) {
  segments_ = rearranged(segments_, before);
  for (std::uint32_t i = 0; i < segments_.size(); ++i)
    if (before[i] == kNewSegment) seed(i, -map_contrast[i]);
}

void ContrastMemory::sweep(std::uint32_t segment, double area_px2) {
  Segment& s = segments_[segment];
  s.swept_px2 += static_cast<float>(area_px2);
  if (s.swept_px2 > kMemory_px2) s.swept_px2 *= 0.5F, s.net *= 0.5F;
}

void ContrastMemory::count(std::uint32_t segment, int net) {
  segments_[segment].net += static_cast<float>(net);
}

void ContrastMemory::count_in_gate(std::uint32_t segment, int net, int all, double way_px, double flow_px) {
  Segment& s = segments_[segment];
  s.gate_net += static_cast<float>(net), s.gate_all += static_cast<float>(all);
  s.way_px += static_cast<float>(way_px), s.flow_px += static_cast<float>(flow_px);
  if (s.gate_all > kGateMemory || s.flow_px > kGateFlow_px)
    s.gate_net *= 0.5F, s.gate_all *= 0.5F, s.way_px *= 0.5F, s.flow_px *= 0.5F;
}

double ContrastMemory::contour_share(std::uint32_t segment, double speed_px_s, double flow_px_s) const {
  const Segment& s = segments_[segment];
  const double net = std::abs(s.gate_net), clutter = 0.5 * (s.gate_all - net);
  const double own = (net + kGateDoubt) / (s.way_px + kGateDoubt_px) * speed_px_s,
               other = (clutter + kGateDoubt) / (s.flow_px + kGateDoubt_px) * flow_px_s;
  if (own + other <= 0) return 0.5;
  return std::clamp(own / (own + other), kLeastShare, 1 - kLeastShare);
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

FilteredEdgeDelay::Value ContrastMemory::edge_delay(std::uint32_t segment, double speed_px_s) const {
  const double events = measured(segment) ? std::abs(steps(segment)) : -1;
  if (filtered_delays_) return (*filtered_delays_)(events, speed_px_s);
  if (events < 0) return {{kUnknownDelay_px, kUnknownDelay_px}, 0};
  return {delays_(step_of_events(events)), 0};
}

}  // namespace evpose
