// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/contour_trust.h"

#include <algorithm>
#include <cmath>

#include "evpose/registration/rearranged.h"

namespace evpose {
namespace {

constexpr double kMemory_s = 0.5;  // of what a segment's events have shown
constexpr double kBelieved = 10;   // weight of events by which a segment is taken for one like all others

}  // namespace

GateSums& GateSums::operator+=(const GateSums& other) {
  weight += other.weight, inside += other.inside, at_gate += other.at_gate;
  return *this;
}

GateSums& GateSums::operator*=(double share) {
  weight *= share, inside *= share, at_gate *= share;
  return *this;
}

void ContourTrust::rearrange(std::span<const std::uint32_t> before) {
  segments_ = rearranged(segments_, before);
}

void ContourTrust::add(std::uint32_t segment, const GateSums& sums) {
  Segment& s = segments_[segment];
  s.sums *= std::exp((s.t_s - now_s_) / kMemory_s);
  s.sums += sums;
  s.t_s = now_s_;
}

double ContourTrust::trust(std::uint32_t segment, double common) const {
  const GateSums& sums = segments_[segment].sums;
  const double slope = (sums.inside - sums.at_gate + kBelieved * common) / (sums.weight + kBelieved);
  return std::clamp(slope / common, 0.0, 1.0);
}

}  // namespace evpose
