// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace evpose {

/// What events have told about the brightness step across each contrast segment of the contours
/// (EV-Pose 5.1): in every pixel that a step sweeps, on less off events number log(contrast) / threshold,
/// whatever texture lies around it. The sign predicts polarities, the size how late events come.
class ContrastMemory {
 public:
  /// `threshold`: of the camera, in log luminance.
  ContrastMemory(std::uint32_t segments, double threshold);

  /// The segment has swept so much of the image.
  void sweep(std::uint32_t segment, double area_px2);
  /// An event near the segment: +1 if it is on and the contour moves along its normal, or off and against it.
  void count(std::uint32_t segment, int sign);

  /// Steps of the threshold across the contour, positive if it is darker in front of it, where its image
  /// normal points; 0 as long as little is known.
  double steps(std::uint32_t segment) const;
  bool known(std::uint32_t segment) const { return segments_[segment].swept_px2 > kLittle_px2; }

  /// How far behind the contour its events lie, px along the motion. Late by a part of a threshold: the pixel
  /// was on average half a threshold short of its first event. And displaced towards the dark side: a pixel's
  /// logarithm is halfway when most of it is still dark, so that brightening (on) is early, darkening late.
  struct EdgeDelay {
    double on_px, off_px;
  };
  EdgeDelay edge_delay(std::uint32_t segment) const;

  static constexpr double kUnknownDelay_px = 0.10;  ///< of contours that have hardly moved yet
  static constexpr double kMemory_px2 = 600;        ///< area swept until what was learnt counts half

 private:
  static constexpr double kLittle_px2 = 40;
  struct Segment {
    float net = 0, swept_px2 = 0;
  };
  double threshold_;
  std::vector<Segment> segments_;
};

}  // namespace evpose
