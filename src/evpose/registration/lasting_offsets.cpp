// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/lasting_offsets.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <utility>

#include "evpose/registration/rearranged.h"

namespace evpose {
namespace {

constexpr double kMemory_s = 0.5;
constexpr double kKnown = 20;       // weight of events by which half of an offset is believed
constexpr double kFewest = 5;       // likewise, by which it counts for the pose's motion
constexpr double kLimit_px = 0.25;  // a segment that stands so far off keeps half of its information
constexpr double kMostTaken = 0.1, kMostOff = 0.35;  // of all weight: what is taken away; what may stand off
constexpr double kPrior = 1e-3;  // of a motion that the contours do not tell, beside one that they do

/// Steep: contours within a tenth of a pixel are the rule, and lose nothing.
double kept(double offset_px, double map_variance_px2) {
  const double ratio = offset_px * offset_px / (kLimit_px * kLimit_px + 4 * map_variance_px2);
  return 1 / (1 + ratio * ratio * ratio * ratio);
}

}  // namespace

void LastingOffsets::rearrange(std::span<const std::uint32_t> before) {
  segments_ = rearranged(segments_, before);
}

void LastingOffsets::forget() {
  segments_.assign(segments_.size(), {});
  standing_off_ = 0;
}

bool LastingOffsets::agree() const { return standing_off_ <= kMostOff; }

void LastingOffsets::remember(const Sample& s) {
  Segment& segment = segments_[s.segment];
  const double left = std::exp((segment.t_s - now_s_) / kMemory_s);
  segment.weight = left * segment.weight + s.weight;
  segment.asked_px = left * segment.asked_px + s.side * s.asked_px;
  segment.t_s = now_s_;
  segment.by_motion_px = segment.map_variance_px2 = segment.samples = 0;
}

/// Of the pose, that explains the segments' offsets best; those that stand off count for little.
Vector6d LastingOffsets::motion(std::span<const Sample> samples) const {
  Matrix6d A = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  for (const Sample& s : samples) {
    const Segment& segment = segments_[s.segment];
    if (segment.weight < kFewest) continue;
    const double ratio = segment.mean_px() / kLimit_px;
    const double weight = segment.weight / (segment.weight + kKnown) / (1 + ratio * ratio);
    A.noalias() += weight * *s.by_pose * s.by_pose->transpose();
    b.noalias() += weight * s.side * segment.mean_px() * *s.by_pose;
  }
  const Vector6d scale = A.diagonal().cwiseMax(1e-9).cwiseSqrt().cwiseInverse();
  Matrix6d scaled = scale.asDiagonal() * A * scale.asDiagonal();
  scaled.diagonal().array() += kPrior;
  return scale.cwiseProduct(scaled.ldlt().solve(scale.cwiseProduct(b)));
}

void LastingOffsets::judge(double span_s, std::span<const Sample> samples) {
  now_s_ += span_s;
  for (const Sample& s : samples) remember(s);
  const Vector6d moved = motion(samples);
  for (const Sample& s : samples) {
    Segment& segment = segments_[s.segment];
    segment.by_motion_px += s.side * s.by_pose->dot(moved);
    segment.map_variance_px2 += s.map_sigma_px * s.map_sigma_px;
    ++segment.samples;
  }
  for (const Sample& s : samples) {
    Segment& segment = segments_[s.segment];
    const double left_px = segment.mean_px() - segment.by_motion_px / segment.samples;
    segment.trust = kept(left_px * segment.weight / (segment.weight + kKnown),
                         segment.map_variance_px2 / segment.samples);
  }
  spare(samples);
}

/// A tenth of all weight is taken away at most: where more stands off, it may be the pose that is wrong.
void LastingOffsets::spare(std::span<const Sample> samples) {
  double all = 0, lost = 0;
  for (const Sample& s : samples) {
    all += s.weight;
    lost += s.weight * (1 - segments_[s.segment].trust);
  }
  if (all > 0) standing_off_ = lost / all;
  if (standing_off_ <= kMostTaken) return;
  for (const Sample& s : samples) {
    Segment& segment = segments_[s.segment];
    if (std::exchange(segment.samples, 0) > 0)  // once for each segment
      segment.trust = 1 - kMostTaken / standing_off_ * (1 - segment.trust);
  }
}

}  // namespace evpose
