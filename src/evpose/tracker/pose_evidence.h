// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace evpose {

/// What the last tenth of a second says of a pose.
struct PoseEvidence {
  double pieces = 0;     ///< of contours, that have moved enough to show themselves; 0: too little was seen
  double explained = 0;  ///< share of these with clearly more events on them than beside, less that by chance
  double ratio = 0;      ///< events on contours to those beside them
  double worst_ratio = 0;  ///< the same of the direction in the image that has the lowest
  bool contested = false;  ///< contours of one direction in the image have hardly more than beside them
};

}  // namespace evpose
