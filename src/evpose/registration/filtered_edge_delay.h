// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "evpose/camera/trail_filter.h"
#include "evpose/registration/edge_delay.h"

namespace evpose {

/// Of a pixel whose sensor drops part of each trail, at a step of so many thresholds: events, and their mean
/// place behind the contour, px.
struct FilteredEvents {
  double events = 0, delay_px = 0;
};

/// The law of edge_delay.h with a trail filter. `sign`: +1 brightening, -1 darkening. `gap_px`: the contour
/// moves so far in the longest gap between the events of a trail. Numeric, over where in its walk the pixel's
/// brightness was found; what texture triggered before the edge counts as another trail.
FilteredEvents filtered_events(TrailFilterKind kind, double thresholds, double threshold, int sign,
                               double gap_px);

/// Delay by the events that a step was seen to make. Behind a filter the step is not told by their number
/// alone (the first event comes once however high the step is): it is the mean over the steps that agree with
/// it, with odds that fall by e over three thresholds, and their spread is the delay's sigma.
class FilteredEdgeDelay {
 public:
  struct Value {
    EdgeDelay delay;
    double sigma_px = 0;
  };
  FilteredEdgeDelay(const TrailFilterSetting& filter, double threshold);
  /// `events`: per pixel swept, >= 0; negative: nothing is known. `speed_px_s`: of the contour, >= 0.
  Value operator()(double events, double speed_px_s) const;

 private:
  static constexpr int kPerEvent = 8, kMostEvents = 10, kGaps = 24;
  static constexpr double kLeastGap_px = 0.02, kMostGap_px = 4;
  struct Cell {
    double mean_px = 0, variance_px2 = 0;
  };
  /// By number of events, the last one of nothing known.
  using Row = std::array<Cell, kPerEvent * kMostEvents + 2>;
  static Row make_row(TrailFilterKind kind, double threshold, int sign, double gap_px);

  double longest_gap_s_;
  std::array<Row, kGaps> on_, off_;
};

}  // namespace evpose
