// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/scene.h"

#include <cmath>
#include <numbers>

namespace evpose::sim {

double LightSwitching::factor(double t_s) const {
  const bool off = off_at_s >= 0 && t_s >= off_at_s && !(on_at_s >= off_at_s && t_s >= on_at_s);
  const double level = off ? off_factor : 1.0;
  return level * (1 + flicker_depth * std::sin(2 * std::numbers::pi * flicker_hz * t_s));
}

}  // namespace evpose::sim
