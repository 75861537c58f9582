// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/flow_monitor.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr float kBehind_px = 2.5F;                // where the edge is asked for
constexpr float kSoonest = 0.5F, kLatest = 2.0F;  // of the time that it took from there
constexpr double kFew = 10;                       // events that tell nothing yet

}  // namespace

void describe(ConfigTable& table, FlowConfig& c) {
  table.add("on", c.on, "mistrust cells whose events do not move as the ego-motion says");
  table.add("memory_s", c.memory_s, "s", "over which events of a cell are judged together", {1e-3, 10});
  table.add("from_px_s", c.from_px_s, "px/s", "contours slower than this tell nothing", {0, 1e4});
  table.add("least_deficit", c.least_deficit, "", "missing share of agreeing events at which mistrust begins",
            {0, 1});
  table.add("full_deficit", c.full_deficit, "", "... and is complete", {0, 1});
  table.add("sure_sigma", c.sure_sigma, "", "... if it is so many sigma from chance", {0, 100});
  table.add("mistrust_s", c.mistrust_s, "s", "how long mistrust lasts", {1e-3, 100});
}

FlowMonitor::Answer FlowMonitor::ask(const TimeSurface& surface, int x, int y, Polarity polarity,
                                     std::uint32_t stamp_us, float nx, float ny, float speed_px_s) const {
  if (std::abs(speed_px_s) < static_cast<float>(config_.from_px_s)) return Answer::unknown;
  const float back = speed_px_s > 0 ? -kBehind_px : kBehind_px;
  const int bx = static_cast<int>(std::lround(back * nx)), by = static_cast<int>(std::lround(back * ny));
  const std::uint32_t then = surface.last(x + bx, y + by, polarity);
  if (then > stamp_us) return Answer::unknown;  // written again since
  if (then == 0) return Answer::differs;
  const float way_px = std::abs(nx * static_cast<float>(bx) + ny * static_cast<float>(by));
  const float taken = 1e-6F * static_cast<float>(stamp_us - then) * std::abs(speed_px_s) / way_px;
  return taken > kSoonest && taken < kLatest ? Answer::agrees : Answer::differs;
}

void FlowMonitor::advance(double span_s) {
  const double keep = std::exp(-span_s / config_.memory_s), forgive = std::exp(-span_s / config_.mistrust_s);
  const auto age = [&](Cell& c) { c.agree *= keep, c.all *= keep, c.mistrust *= forgive; };
  std::for_each(cells_.begin(), cells_.end(), age);
  age(image_);
}

void FlowMonitor::add(std::uint32_t cell, double agree, double differ) {
  if (cell >= cells_.size()) cells_.resize(cell + 1);
  for (Cell* c : {&cells_[cell], &image_}) c->agree += agree, c->all += agree + differ;
}

double FlowMonitor::trust(std::uint32_t cell) {
  if (!config_.on || cell >= cells_.size()) return 1;
  Cell& c = cells_[cell];
  if (c.all > kFew) {
    const double usual = image_.agree / image_.all, missing = usual - c.agree / c.all;
    const double chance = std::sqrt(usual * (1 - usual) / c.all);
    const double range = std::max(1e-6, config_.full_deficit - config_.least_deficit);
    if (missing > config_.sure_sigma * chance)
      c.mistrust = std::max(c.mistrust, std::clamp((missing - config_.least_deficit) / range, 0.0, 1.0));
  }
  return 1 - c.mistrust;
}

}  // namespace evpose
