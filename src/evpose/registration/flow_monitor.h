// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/event/event_preprocessor.h"

namespace evpose {

/// Ego-motion instructed extraction (EV-Pose 5.3). Behind an edge that moves as the ego-motion says, a pixel
/// fired for the same edge just as long ago as it says; behind a moving thing, or structure at another depth,
/// it did so at some other time. The share of events for which it holds is compared, cell by cell, with the
/// usual share in the image.
class FlowMonitor {
 public:
  enum class Answer : std::uint8_t { unknown, agrees, differs };
  /// Of one event near a contour with the image normal n and this speed along it.
  static Answer compare(const TimeSurface& surface, const FilteredEvent& event, float nx, float ny,
                        float speed_px_s);

  /// Lets what was seen so far count less.
  void advance(double span_s);
  void add(std::uint32_t cell, double agree, double differ);
  /// Brings the mistrust in a cell up to date. 1: its events move as they should, as far as is known.
  double trust(std::uint32_t cell);

 private:
  struct Cell {
    double agree = 0, all = 0, mistrust = 0;
  };
  std::vector<Cell> cells_;
  Cell image_;  ///< all cells together
};

}  // namespace evpose
