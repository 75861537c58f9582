// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace evpose {

/// What sums over events in the gates of contours say of how far the events gather at the contours.
struct GateSums {
  double weight = 0;   ///< of the events
  double inside = 0;   ///< by how much their weighted distances follow an offset that none of them leaves by
  double at_gate = 0;  ///< by how much less for those that it moves out of the gate

  GateSums& operator+=(const GateSums& other);
  GateSums& operator*=(double share);
  /// Derivative of the mean distance by an offset: 1 for events that all lie at the contours, 0 for events
  /// spread evenly over the gates. Noise may take it beyond. Weight must not be 0.
  double slope() const { return (inside - at_gate) / weight; }
};

/// How far the events bear out each contour of a map that may be wrong. At a contour that is none, or that
/// stands on nothing that makes events, those in its gate are of the texture around it and spread evenly:
/// whatever the pose, they say that the contour is where it is expected. Unlike the gate concentration over
/// all contours this tells the wrong ones of a map from the right ones.
class ContourTrust {
 public:
  explicit ContourTrust(std::uint32_t segments) : segments_(segments) {}

  /// The segments are others now; see rearranged().
  void rearrange(std::span<const std::uint32_t> before);
  /// Time passes: what was seen before counts less.
  void advance(double span_s) { now_s_ += span_s; }
  void add(std::uint32_t segment, const GateSums& sums);
  /// Share of its events' information that a segment may keep, 0..1: the slope of its events over `common`,
  /// that of all contours; near 1 while few events have come.
  double trust(std::uint32_t segment, double common) const;

 private:
  struct Segment {
    GateSums sums;
    double t_s = 0;  ///< of the last events
  };
  double now_s_ = 0;
  std::vector<Segment> segments_;
};

}  // namespace evpose
