// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/core/pose.h"

namespace evpose {

/// Contours whose events keep to a place beside them, where no motion of the pose would bring them in line
/// with the others: beside a shadow's edge, a print, the second edge of a board. Nearly all contours of a
/// true map have their events within 0.1 px in the mean of half a second; a few have them 0.3 px and more
/// off, each the same way for as long as it is in view, and where little is in view these hold the pose.
class LastingOffsets {
 public:
  explicit LastingOffsets(std::uint32_t segments) : segments_(segments) {}

  /// The segments are others now; see rearranged().
  void rearrange(std::span<const std::uint32_t> before);
  /// What was seen up to now does not count any more.
  void forget();

  /// What the events of one update say of one sample of a contour.
  struct Sample {
    std::uint32_t segment;
    int side;                 ///< +1 if its normal is that of the segment in the map, else -1
    double weight;            ///< of its events
    double asked_px;          ///< sum over these, weight times distance by which the contour should move
    double map_sigma_px;      ///< error of the map there
    const Vector6d* by_pose;  ///< derivative of the contour's place, px, by the pose, as Pose::plus
  };
  /// One update.
  void judge(double span_s, std::span<const Sample> samples);
  /// Share of its events' information that a segment may keep, 0..1.
  double trust(std::uint32_t segment) const { return segments_[segment].trust; }
  /// Whether the contours agree on a pose but for a few. Where pixels are late by more than the gate, and
  /// where the pose is off, events lie evenly in the gates, and each contour stands off in its own way.
  bool agree() const;

 private:
  struct Segment {
    double weight = 0, asked_px = 0;  ///< sums over the memory
    double t_s = 0;                   ///< of the last events
    double trust = 1;
    // Means over the samples of one update.
    double by_motion_px = 0, map_variance_px2 = 0, samples = 0;

    double mean_px() const { return asked_px / weight; }
  };
  void remember(const Sample& sample);
  void spare(std::span<const Sample> samples);
  Vector6d motion(std::span<const Sample> samples) const;

  double now_s_ = 0;
  double standing_off_ = 0;  ///< share of the events' weight that contours which stand off would lose
  std::vector<Segment> segments_;
};

}  // namespace evpose
