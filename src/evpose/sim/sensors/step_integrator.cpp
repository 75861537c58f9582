// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/step_integrator.h"

#include <algorithm>

namespace evpose::sim {
namespace {

LuminanceCurve line(float from, float to) {
  LuminanceCurve curve;
  curve.add(0, from);
  curve.add(1, to);
  return curve;
}

}  // namespace

// The truth of the events that a pixel has appended.
void StepIntegrator::annotate(std::size_t i, std::size_t first_event) {
  if (first_event == events.size()) return;
  const int flags = before.flags[i] | after.flags[i];
  const EventOrigin origin = (flags & TileSamples::kMoving) != 0    ? EventOrigin::moving
                             : (flags & TileSamples::kOutline) != 0 ? EventOrigin::edge
                                                                    : EventOrigin::texture;
  for (std::size_t e = first_event; e < events.size(); ++e) {
    events[e].object = after.object[i];
    events[e].origin = origin;
  }
}

void StepIntegrator::expose(std::size_t i, const LuminanceCurve& curve) {
  const double length_ns = static_cast<double>(t1 - t0);
  for (Exposure* exposure : exposures) {
    const TimeNs open = std::max(t0, exposure->open), close = std::min(t1, exposure->close);
    if (open >= close) continue;
    const float seen = curve.integral(static_cast<double>(open - t0) / length_ns,
                                      static_cast<double>(close - t0) / length_ns);
    exposure->sum[index(i)] +=
        static_cast<float>(to_seconds(t1 - t0)) * seen + static_cast<float>(to_seconds(close - open)) * glare;
  }
}

// Advances one pixel along its luminance curve.
void StepIntegrator::advance_along(std::size_t i, const LuminanceCurve& curve) {
  const std::size_t first_event = events.size();
  TimeNs from_t = t0;
  for (int k = 1; k < curve.knots; ++k) {
    const TimeNs to_t =
        k + 1 == curve.knots ? t1 : t0 + static_cast<TimeNs>(curve.time[k] * static_cast<float>(t1 - t0));
    if (to_t <= from_t) continue;
    pixels.advance(index(i), from_t, to_t, curve.luminance[k - 1] + glare, curve.luminance[k] + glare,
                   events);
    from_t = to_t;
  }
  knots += curve.knots - 2;
  expose(i, curve);
  annotate(i, first_event);
}

// Advances the pixels whose luminance hardly changes; lists the others.
void StepIntegrator::advance_even(std::vector<std::uint16_t>& uneven) {
  for (int y = 0; y < plan.tile.height; ++y) {
    for (int x = 0; x < plan.tile.width; x += kLanes) {
      const std::size_t first = static_cast<std::size_t>(y) * kTilePx + x;
      const int n = std::min(kLanes, plan.tile.width - x);
      unsigned left = (1U << n) - 1;
      if (n == kLanes) {
        const FloatLanes p = load(&before.luminance[first]), q = load(&after.luminance[first]);
        const IntLanes even = (p <= kLinearRatio * q) & (q <= kLinearRatio * p);
        left &= ~pixels.advance_quiet(index(first), t0, t1, p + glare, q + glare, even);
      }
      for (int k = 0; k < n; ++k) {
        const std::size_t i = first + k;
        if (!exposures.empty() && nearly_equal(before.luminance[i], after.luminance[i]))
          expose(i, line(before.luminance[i], after.luminance[i]));
        if ((left >> k & 1) == 0) continue;
        if (!nearly_equal(before.luminance[i], after.luminance[i])) {
          uneven.push_back(static_cast<std::uint16_t>(i));
          continue;
        }
        const std::size_t first_event = events.size();
        pixels.advance(index(i), t0, t1, before.luminance[i] + glare, after.luminance[i] + glare, events);
        annotate(i, first_event);
      }
    }
  }
}

void StepIntegrator::advance_uneven(const std::vector<std::uint16_t>& uneven) {
  // Between two samples of one texture: number of further samples.
  const auto between = [&](std::size_t i) {
    if (before.patch[i] < 0 || before.patch[i] != after.patch[i]) return 0;
    return texture_samples_between(before.luminance[i], after.luminance[i]);
  };
  std::array<Resampled, kQuarters> quarters;
  for (int k = 0; k < kQuarters; ++k) {
    std::vector<std::uint16_t> wanted;
    for (const std::uint16_t i : uneven)
      if (between(i) == kQuarters || (between(i) == 1 && k == 1)) wanted.push_back(i);
    if (wanted.empty()) continue;
    const SceneView view = interpolate_view(views[0], views[1], 0.25 * (k + 1));
    TileSampler::Again again(sampler, view);
    for (const std::uint16_t i : wanted) again.add(i, after.patch[i]);
    again.shade();
    for (std::size_t w = 0; w < wanted.size(); ++w) quarters[k].luminance[wanted[w]] = again.luminance(w);
  }
  for (const std::uint16_t i : uneven) {
    LuminanceCurve curve = line(before.luminance[i], after.luminance[i]);
    if (before.border[i] >= 0 || after.border[i] >= 0) {
      const PixelSample p = before.pixel(i), q = after.pixel(i);
      if (has_border(p) || has_border(q))
        curve = border_curve(prepared, views[0], views[1], sampler.ray(i), p, q);
    } else if (const int count = between(i); count > 0) {
      curve.knots = 1;
      const int step = 4 / (count + 1);
      for (int k = step; k < 4; k += step)
        curve.add(0.25F * static_cast<float>(k), quarters[k - 1].luminance[i]);
      curve.add(1, after.luminance[i]);
    }
    advance_along(i, curve);
  }
}

void StepIntegrator::integrate() {
  std::vector<std::uint16_t> uneven;
  advance_even(uneven);
  advance_uneven(uneven);
}

}  // namespace evpose::sim
