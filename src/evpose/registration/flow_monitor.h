// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/event/time_surface.h"

namespace evpose {

class ConfigTable;

struct FlowConfig {
  bool on = false;         ///< it costs more standing edges than it takes moving things, on what was measured
  double memory_s = 0.05;  ///< over which events of a cell are judged together
  double from_px_s = 20;   ///< contours slower than this tell nothing
  double least_deficit = 0.15;  ///< mistrust begins when so much of the usual share is missing ...
  double full_deficit = 0.3;    ///< ... and is complete here
  double sure_sigma = 3;        ///< ... if it is more than chance
  double mistrust_s = 0.1;      ///< how long mistrust lasts
};
void describe(ConfigTable& table, FlowConfig& config);

/// Ego-motion instructed extraction (EV-Pose 5.3). Behind an edge that moves as the ego-motion says, a pixel
/// fired for the same edge just as long ago as it says; behind a moving thing, or structure at another depth,
/// it did so at some other time. The share of events for which it holds is compared, cell by cell, with the
/// usual share in the image.
class FlowMonitor {
 public:
  explicit FlowMonitor(const FlowConfig& config) : config_(config) {}

  enum class Answer : std::uint8_t { unknown, agrees, differs };
  /// Of one event near a contour with the image normal n and this speed along it.
  Answer ask(const TimeSurface& surface, int x, int y, Polarity polarity, std::uint32_t stamp_us, float nx,
             float ny, float speed_px_s) const;

  /// Time goes on: what was seen counts less.
  void advance(double span_s);
  void add(std::uint32_t cell, double agree, double differ);
  /// Brings the mistrust in a cell up to date. 1: its events move as they should, as far as one knows.
  double trust(std::uint32_t cell);

 private:
  struct Cell {
    double agree = 0, all = 0, mistrust = 0;
  };
  FlowConfig config_;
  std::vector<Cell> cells_;
  Cell image_;  ///< all cells together
};

}  // namespace evpose
