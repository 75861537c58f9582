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

StepIntegrator::QuarterViews StepIntegrator::quarter_views(const SceneView& from, const SceneView& to) {
  QuarterViews out;
  for (int k = 0; k < kQuarters; ++k) out[k] = interpolate_view(from, to, 0.25 * (k + 1));
  return out;
}

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

void StepIntegrator::add_uneven(std::size_t i, Uneven& uneven) const {
  const int between = before.patch[i] >= 0 && before.patch[i] == after.patch[i]
                          ? texture_samples_between(before.luminance[i], after.luminance[i])
                          : 0;
  uneven.pixel[uneven.count] = static_cast<std::uint8_t>(i);
  uneven.between[uneven.count] = static_cast<std::uint8_t>(between);
  ++uneven.wanting[between];
  ++uneven.count;
}

// Advances the pixels whose luminance hardly changes; lists the others.
void StepIntegrator::advance_even(Uneven& uneven) {
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
          add_uneven(i, uneven);
          continue;
        }
        const std::size_t first_event = events.size();
        pixels.advance(index(i), t0, t1, before.luminance[i] + glare, after.luminance[i] + glare, events);
        annotate(i, first_event);
      }
    }
  }
}

void StepIntegrator::advance_uneven(const Uneven& uneven) {
  std::array<std::array<float, kTilePixels>, kQuarters> between;  // luminance, by place in the list
  for (int k = 0; k < kQuarters; ++k) {
    const bool middle = k == 1;
    if (uneven.wanting[kQuarters] == 0 && !(middle && uneven.wanting[1] > 0)) continue;
    TileSampler::Again again(sampler, quarters[k]);
    const auto wants = [&](std::size_t u) {
      return uneven.between[u] == kQuarters || (middle && uneven.between[u] == 1);
    };
    for (std::size_t u = 0; u < uneven.count; ++u)
      if (wants(u)) again.add(uneven.pixel[u], after.patch[uneven.pixel[u]]);
    again.shade();
    std::size_t answer = 0;
    for (std::size_t u = 0; u < uneven.count; ++u)
      if (wants(u)) between[k][u] = again.luminance(answer++);
  }
  for (std::size_t u = 0; u < uneven.count; ++u) {
    const std::size_t i = uneven.pixel[u];
    LuminanceCurve curve = line(before.luminance[i], after.luminance[i]);
    if (before.border[i] >= 0 || after.border[i] >= 0) {
      const PixelSample p = before.pixel(i), q = after.pixel(i);
      if (has_border(p) || has_border(q))
        curve = border_curve(prepared, views[0], views[1], sampler.ray(i), p, q);
    } else if (uneven.between[u] > 0) {
      curve.knots = 1;
      const int step = 4 / (uneven.between[u] + 1);
      for (int k = step; k < 4; k += step) curve.add(0.25F * static_cast<float>(k), between[k - 1][u]);
      curve.add(1, after.luminance[i]);
    }
    advance_along(i, curve);
  }
}

void StepIntegrator::integrate() {
  Uneven uneven;
  advance_even(uneven);
  advance_uneven(uneven);
}

}  // namespace evpose::sim
