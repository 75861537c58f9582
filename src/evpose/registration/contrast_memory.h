// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "evpose/registration/filtered_edge_delay.h"

namespace evpose {

/// What events have told about the brightness step across each contrast segment of the contours
/// (EV-Pose 5.1): in every pixel that a step sweeps, on less off events number log(contrast) / threshold,
/// whatever texture lies around it. The sign predicts polarities, the size how late events come.
class ContrastMemory {
 public:
  /// `threshold`: of the camera, in log luminance; `filter`: of its sensor.
  ContrastMemory(std::uint32_t segments, double threshold, const TrailFilterSetting& filter = {});

  /// What the map says of a step's sign, -1, 0 or +1 as steps(). It counts until events have told more.
  void seed(std::uint32_t segment, int sign);
  /// The segments are those of another part of the map from now on; see rearranged(). `map_contrast[i]`: what
  /// the map says of one, as ContourPoint::contrast.
  void rearrange(std::span<const std::uint32_t> before, std::span<const int> map_contrast);
  /// The segment has swept so much of the image.
  void sweep(std::uint32_t segment, double area_px2);
  /// On less off events near the segment, as it would be if its normal pointed along its motion.
  void count(std::uint32_t segment, int net);
  /// Events in the gates of the segment, of both polarities: on less off as count(), and all; while the
  /// contour moved so far across itself, and the image there in any direction.
  void count_in_gate(std::uint32_t segment, int net, int all, double way_px, double flow_px);

  /// Steps of the threshold across the contour, positive if it is darker in front of it, where the map's
  /// normal points; near 0 as long as little is known.
  double steps(std::uint32_t segment) const;
  /// Events or the map have told the sign.
  bool known(std::uint32_t segment) const { return segments_[segment].seeded || measured(segment); }
  /// Events have told the step.
  bool measured(std::uint32_t segment) const { return segments_[segment].swept_px2 > kLittle_px2; }
  /// -1, 0 (not known or no step to speak of) or +1, as ContourPoint::contrast: +1 if it is brighter where
  /// the map's normal points.
  int map_contrast(std::uint32_t segment) const;

  /// Share of the contour's own among the events of its polarity in its gates, while it moves across itself
  /// at one speed and the image at another, both >= 0. Texture beside it makes as many of one polarity as of
  /// the other, so that as many are clutter as are of the wrong one. Its own grow with the way across itself,
  /// those of texture with the way of the image, however the contour lies. As many of one as of the other for
  /// the same way as long as little is known.
  double contour_share(std::uint32_t segment, double speed_px_s, double flow_px_s) const;

  /// Of the segment, by the step that events have told of, moving at so much in the image, >= 0.
  FilteredEdgeDelay::Value edge_delay(std::uint32_t segment, double speed_px_s) const;

  static constexpr double kSureSteps = 0.3;         ///< contrast from which on a sign is relied on
  static constexpr double kUnknownDelay_px = 0.10;  ///< of contours that have hardly moved yet
  static constexpr double kMemory_px2 = 600;        ///< area swept until what was learnt counts half

 private:
  static constexpr double kLittle_px2 = 40;
  struct Segment {
    float net = 0, swept_px2 = 0;
    float gate_net = 0, gate_all = 0, way_px = 0, flow_px = 0;
    bool seeded = false;
  };
  EdgeDelayTable delays_;
  std::optional<FilteredEdgeDelay> filtered_delays_;  ///< if the sensor has a trail filter
  std::vector<Segment> segments_;
};

}  // namespace evpose
