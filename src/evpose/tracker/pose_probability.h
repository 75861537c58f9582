// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/tracker/pose_evidence.h"

namespace evpose {

/// The probability that a pose is the right one and not another that happens to agree with some events. Each
/// look at its contours multiplies the odds by how much more often right poses look like that than wrong ones
/// do; neighbouring looks show the same events, so only one in each 0.05 s counts.
class PoseProbability {
 public:
  /// From here on a pose is called tracking.
  static constexpr double kBelieved = 0.999;

  /// A pose that someone states is seldom wrong; one that was found among many is as often wrong as right.
  void given();
  void found();
  /// One update's look, `span_s` long; its registration was used. Nothing if too little was seen.
  void add(const PoseEvidence& look, double gate_concentration, double span_s);
  /// Something else than events shows that the pose is right.
  void confirm();

  double value() const;
  bool is_believed() const { return value() >= kBelieved; }

  /// Natural logarithm of the odds of right against wrong that one look tells by itself.
  static double log_odds(const PoseEvidence& look, double gate_concentration);

 private:
  double log_odds_ = 0;
};

}  // namespace evpose
