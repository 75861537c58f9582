// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/drift_monitor.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr double kFew = 8;  // events that tell no drift yet

}  // namespace

void describe(ConfigTable& table, DriftConfig& c) {
  table.add("on", c.on, "mistrust events that drift along with something else than the ego-motion");
  table.add("memory_s", c.memory_s, "s", "over which a drift is measured", {1e-3, 10});
  table.add("from_px_s", c.from_px_s, "px/s", "smaller drifts are nobody's motion", {0, 1e4});
  table.add("from_share", c.from_share, "", "... nor are those below this share of the contour's own motion",
            {0, 10});
  table.add("from_sigma", c.from_sigma, "", "mistrust begins so many sigma above that", {0.1, 100});
  table.add("event_sigma_px", c.event_sigma_px, "px", "scatter of events", {0.05, 10});
  table.add("mistrust_s", c.mistrust_s, "s", "how long mistrust lasts", {1e-3, 100});
}

void DriftMonitor::advance(double span_s) {
  const double keep = std::exp(-span_s / config_.memory_s);
  const double forgive = std::exp(-span_s / config_.mistrust_s);
  for (Cell& c : cells_) {
    const Events e = c.events;
    c.events = {keep * e.n, keep * (e.age + e.n * span_s), keep * e.distance,
                keep * (e.age2 + 2 * span_s * e.age + span_s * span_s * e.n),
                keep * (e.age_distance + span_s * e.distance)};
    c.speed *= keep;
    c.mistrust *= forgive;
  }
}

void DriftMonitor::add(std::uint32_t cell, const Events& e, double speed_px_s) {
  if (cell >= cells_.size()) cells_.resize(cell + 1);
  Cell& c = cells_[cell];
  c.events.n += e.n;
  c.events.age += e.age;
  c.events.distance += e.distance;
  c.events.age2 += e.age2;
  c.events.age_distance += e.age_distance;
  c.speed += e.n * speed_px_s;
}

DriftMonitor::Drift DriftMonitor::drift(std::uint32_t cell) const {
  if (cell >= cells_.size() || !(cells_[cell].events.n > kFew)) return {};
  const Events& e = cells_[cell].events;
  const double spread = e.age2 - e.age * e.age / e.n;
  if (!(spread > 1e-12)) return {};
  return {-(e.age_distance - e.age * e.distance / e.n) / spread, config_.event_sigma_px / std::sqrt(spread)};
}

double DriftMonitor::trust(std::uint32_t cell) {
  if (!config_.on || cell >= cells_.size()) return 1;
  Cell& c = cells_[cell];
  const Drift d = drift(cell);
  if (d.sigma_px_s > 0) {
    const double excess = std::abs(d.px_s) - config_.from_px_s - config_.from_share * c.speed / c.events.n;
    const double steps = excess / (config_.from_sigma * d.sigma_px_s);
    c.mistrust = std::max(c.mistrust, std::clamp(steps - 1, 0.0, 1.0));
  }
  return 1 - c.mistrust;
}

}  // namespace evpose
