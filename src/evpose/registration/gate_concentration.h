// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/registration/contour_trust.h"

namespace evpose {

/// How far the events in all gates gather at the contours (gate concentration), from sums over them with
/// exponential forgetting: 1 for events that all lie near the contours, 0 for events spread evenly.
class GateConcentration {
 public:
  /// Time passes: what was seen before counts less, the sooner the more events there are.
  void decay(double span_s);
  void add(const GateSums& events) { sums_ += events; }

  /// Enough events have been seen for it to be believed.
  bool known() const;
  /// From 0.15 on, which keeps finite what is divided by it, up to 1; 1 where no event was seen.
  double value() const;
  /// False for events spread evenly over the gates: the pose is not where it is thought to be.
  bool consistent() const;
  /// Of the information that events have where they gather. The mean of events of which a share c is of the
  /// contour moves by c for each px, under the noise of all of them: what it tells of the contour goes with c
  /// squared.
  double share_of_information() const;

 private:
  GateSums sums_;
};

}  // namespace evpose
