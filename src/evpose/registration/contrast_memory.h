// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace evpose {

class ConfigTable;

struct ContrastConfig {
  double threshold = 0.25;            ///< contrast of the log luminance that makes an event
  double lateness_px = 0.06;          ///< events come at least so much after the contour
  double threshold_px = 0.04;         ///< ... and by this more if the contrast is one threshold, half for two
  double latest_px = 0.16;            ///< ... but not by more than this
  double unknown_lateness_px = 0.10;  ///< of contours that have hardly moved yet
  double memory_px2 = 600;            ///< area that a piece sweeps until what it learnt counts half
};
void describe(ConfigTable& table, ContrastConfig& config);

/// What events have told about the brightness step across each contour piece (EV-Pose 5.1): in every pixel
/// that a step sweeps, on less off events number log(contrast) / threshold, whatever texture lies around it.
/// The sign predicts polarities, the size how late events come.
class ContrastMemory {
 public:
  ContrastMemory(std::uint32_t pieces, const ContrastConfig& config);

  /// The piece has swept so much of the image.
  void sweep(std::uint32_t piece, double area_px2);
  /// An event near the piece: +1 if it is on and the contour moves along its normal, or off and against it.
  void count(std::uint32_t piece, int sign);

  /// Steps of the threshold across the contour, positive if it is darker in front of it, where its normal
  /// points; 0 as long as little is known.
  double steps(std::uint32_t piece) const;
  bool known(std::uint32_t piece) const { return pieces_[piece].swept_px2 > kLittle_px2; }

  /// How far behind the contour its events lie, px along the motion. Late by a part of a threshold: the pixel
  /// was on average half a threshold short of its first event. And displaced towards the dark side: a pixel's
  /// logarithm is halfway when most of it is still dark, so that brightening (on) is early, darkening late.
  struct Lateness {
    double on_px, off_px;
  };
  Lateness lateness(std::uint32_t piece) const;

 private:
  static constexpr double kLittle_px2 = 40;
  struct Piece {
    float net = 0, swept_px2 = 0;
  };
  ContrastConfig config_;
  std::vector<Piece> pieces_;
};

}  // namespace evpose
