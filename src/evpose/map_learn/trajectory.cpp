// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/trajectory.h"

#include <algorithm>

#include "evpose/core/error.h"

namespace evpose::map_learn {

FusionState state_at(const Trajectory& trajectory, TimeNs t) {
  EVPOSE_CHECK(!trajectory.empty());
  const auto after = std::upper_bound(trajectory.begin(), trajectory.end(), t,
                                      [](TimeNs time, const FusionState& s) { return time < s.t; });
  if (after == trajectory.begin()) return trajectory.front();
  const FusionState& a = *(after - 1);
  FusionState out = a;
  if (after == trajectory.end() || a.t == t) return out;
  const double u = to_seconds(t - a.t) / to_seconds(after->t - a.t);
  out.t = t;
  out.nav.T_map_body = interpolate(a.nav.T_map_body, after->nav.T_map_body, u);
  out.nav.velocity += u * (after->nav.velocity - a.nav.velocity);
  out.angular_rate += u * (after->angular_rate - a.angular_rate);
  return out;
}

void add_at_knots(const std::vector<std::size_t>& knots, const std::vector<Vector15d>& errors,
                  Trajectory& trajectory) {
  EVPOSE_CHECK(!knots.empty() && knots.front() == 0 && knots.size() == errors.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    while (k + 1 < knots.size() && knots[k + 1] <= i) ++k;
    Vector15d error = errors[k];
    if (k + 1 < knots.size()) {
      const double u = to_seconds(trajectory[i].t - trajectory[knots[k]].t) /
                       to_seconds(trajectory[knots[k + 1]].t - trajectory[knots[k]].t);
      error += u * (errors[k + 1] - errors[k]);
    }
    trajectory[i].add(error);
  }
}

}  // namespace evpose::map_learn
