// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace evpose::sim {

double LightSwitching::factor(double t_s) const {
  // Completed fraction of a fade that began at `start`.
  const auto done = [&](double start) {
    if (start < 0) return 0.0;
    return fade_s > 0 ? std::clamp((t_s - start) / fade_s, 0.0, 1.0) : (t_s >= start ? 1.0 : 0.0);
  };
  const double on = 1 - done(off_at_s) + (on_at_s > off_at_s ? done(on_at_s) : 0.0);
  const double level = off_factor + (1 - off_factor) * on;
  return level * (1 + flicker_depth * std::sin(2 * std::numbers::pi * flicker_hz * t_s));
}

double LightSwitching::step_s(double t_s) const {
  constexpr double kStepsPerPeriod = 16, kStepsPerFade = 16;
  double step =
      flicker_depth > 0 ? 1 / (kStepsPerPeriod * flicker_hz) : std::numeric_limits<double>::infinity();
  for (const double start : {off_at_s, on_at_s}) {
    if (start >= 0 && t_s >= start && t_s < start + fade_s) step = std::min(step, fade_s / kStepsPerFade);
  }
  return step;
}

double LightSwitching::next_switch_s(double t_s) const {
  double next = std::numeric_limits<double>::infinity();
  for (const double start : {off_at_s, on_at_s}) {
    if (start > t_s) next = std::min(next, start);
  }
  return next;
}

}  // namespace evpose::sim
