// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace evpose {

class ConfigTable;

struct DriftConfig {
  bool on = true;
  double memory_s = 0.03;       ///< over which a drift is measured
  double from_px_s = 15;        ///< a drift smaller than this is nobody's motion
  double from_share = 0.3;      ///< ... nor than this share of the contour's own motion
  double from_sigma = 3;        ///< mistrust begins at so many sigma above that, and is complete at twice
  double event_sigma_px = 0.9;  ///< scatter of events about a contour or whatever moves there
  double mistrust_s = 0.15;     ///< how long mistrust lasts
};
void describe(ConfigTable& table, DriftConfig& config);

/// Ego-motion instructed extraction (EV-Pose 5.3): events of what stands still keep their distance from the
/// contours that the ego-motion moves; those of a moving thing, or of structure at another depth, drift. The
/// drift is the slope of distance over time of each cell's events, by least squares with a short memory.
class DriftMonitor {
 public:
  explicit DriftMonitor(const DriftConfig& config) : config_(config) {}

  /// Sums over events near contours: of one, age, distance (along the cell's common direction), age squared,
  /// age times distance; ages since the newest update, s.
  struct Events {
    double n = 0, age = 0, distance = 0, age2 = 0, age_distance = 0;
  };
  /// Time goes on: what was seen becomes older and counts less.
  void advance(double span_s);
  /// `speed_px_s`: of the contour that they are near to, without sign.
  void add(std::uint32_t cell, const Events& events, double speed_px_s);

  struct Drift {
    double px_s = 0, sigma_px_s = 0;  ///< sigma 0: nothing is known
  };
  Drift drift(std::uint32_t cell) const;
  /// Brings the mistrust in a cell up to date. 1: its events stand still as far as one knows, 0: they move.
  double trust(std::uint32_t cell);

 private:
  struct Cell {
    Events events;
    double speed = 0;  ///< sum over events
    double mistrust = 0;
  };
  DriftConfig config_;
  std::vector<Cell> cells_;
};

}  // namespace evpose
