// SPDX-License-Identifier: BSD-3-Clause
// Without OpenCV.
#include "evpose/calibrate/board_finder.h"

namespace evpose {

bool BoardFinder::available() { return false; }

std::optional<LatticePixels> BoardFinder::find(std::span<const float>, ImageSize,
                                               const LatticePixels&) const {
  return {};
}

}  // namespace evpose
