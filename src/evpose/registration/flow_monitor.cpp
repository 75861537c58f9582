// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/flow_monitor.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr float kBehind_px = 2.5F;                // where the edge's earlier event is looked for
constexpr float kSoonest = 0.5F, kLatest = 2.0F;  // of the predicted time from there: agreement
constexpr float kFrom_px_s = 20;    // slower contours tell nothing: noise overwrites their traces
constexpr double kMemory_s = 0.05;  // over which events of a cell are judged together
constexpr double kFew = 10;         // events that tell nothing yet
constexpr double kLeastDeficit = 0.15,
                 kFullDeficit = 0.3;  // missing share of agreement: mistrust begins, is full
constexpr double kSureSigma = 3;      // from chance, for a deficit to count
constexpr double kMistrust_s = 0.1;   // decay time of mistrust

}  // namespace

FlowMonitor::Answer FlowMonitor::compare(const TimeSurface& surface, const FilteredEvent& e, float nx,
                                         float ny, float speed_px_s) {
  if (std::abs(speed_px_s) < kFrom_px_s) return Answer::unknown;
  const float back = speed_px_s > 0 ? -kBehind_px : kBehind_px;
  const int bx = static_cast<int>(std::lround(back * nx)), by = static_cast<int>(std::lround(back * ny));
  const std::uint32_t then = surface.last(e.x + bx, e.y + by, e.on ? Polarity::on : Polarity::off);
  if (then > e.stamp_us) return Answer::unknown;  // written again since
  if (then == 0) return Answer::differs;
  const float way_px = std::abs(nx * static_cast<float>(bx) + ny * static_cast<float>(by));
  const float taken = 1e-6F * static_cast<float>(e.stamp_us - then) * std::abs(speed_px_s) / way_px;
  return taken > kSoonest && taken < kLatest ? Answer::agrees : Answer::differs;
}

void FlowMonitor::advance(double span_s) {
  const double keep = std::exp(-span_s / kMemory_s), forgive = std::exp(-span_s / kMistrust_s);
  const auto age = [&](Cell& c) { c.agree *= keep, c.all *= keep, c.mistrust *= forgive; };
  std::for_each(cells_.begin(), cells_.end(), age);
  age(image_);
}

void FlowMonitor::add(std::uint32_t cell, double agree, double differ) {
  if (cell >= cells_.size()) cells_.resize(cell + 1);
  for (Cell* c : {&cells_[cell], &image_}) c->agree += agree, c->all += agree + differ;
}

double FlowMonitor::trust(std::uint32_t cell) {
  if (cell >= cells_.size()) return 1;
  Cell& c = cells_[cell];
  if (c.all > kFew) {
    const double usual = image_.agree / image_.all, missing = usual - c.agree / c.all;
    const double chance = std::sqrt(usual * (1 - usual) / c.all);
    if (missing > kSureSigma * chance)
      c.mistrust = std::max(c.mistrust,
                            std::clamp((missing - kLeastDeficit) / (kFullDeficit - kLeastDeficit), 0.0, 1.0));
  }
  return 1 - c.mistrust;
}

}  // namespace evpose
