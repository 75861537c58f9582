// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/luminance_curve.h"

#include <algorithm>
#include <cmath>

namespace evpose::sim {
namespace {

// Luminance ratios from which a curve gets more knots: event times are then good to a hundredth of a pixel of
// motion.
constexpr float kModerateChange = 1.12F, kLargeChange = 1.35F;
// A border whose luminance at either end differs from the sample by a larger ratio does not explain the
// pixel.
constexpr float kLargestMisfit = 1.1F;

float ratio(float a, float b) { return a > b ? a / b : b / a; }

struct GroupLuminance {
  float group, other;
};

// Luminance of the two groups of the border at one end, from the sample there. A group that the sample does
// not show has the luminance of the other end.
bool group_luminance(const PixelSample& border, const PixelSample& at, GroupLuminance& out) {
  out = {border.group_luminance, border.other_luminance};
  if (at.other >= 0 || (at.other == kSky && at.group >= 0)) {
    if (at.group == border.group && at.other == border.other)
      out = {at.group_luminance, at.other_luminance};
    else if (at.group == border.other && at.other == border.group)
      out = {at.other_luminance, at.group_luminance};
    else
      return false;
    return true;
  }
  if (at.other != kNone) return false;
  if (at.group == border.group)
    out.group = at.luminance;
  else if (at.group == border.other)
    out.other = at.luminance;
  else
    return false;
  return true;
}

bool has_border(const PixelSample& s) { return s.other != kNone && s.other != kMany; }

// Adds the knots between the ends. Returns false if the border does not explain the two samples.
bool add_border_knots(const CurveContext& c, const PixelSample& p, const PixelSample& q, const PixelRay& ray,
                      int intervals, LuminanceCurve& curve) {
  const PixelSample& s = has_border(q) ? q : p;
  GroupLuminance from{}, to{};
  if (!group_luminance(s, p, from) || !group_luminance(s, q, to)) return false;
  const Border first = border_of(c.prepared, c.from, s), last = border_of(c.prepared, c.to, s);
  const float level0 = first.level(ray), level1 = last.level(ray);
  const Eigen::Vector2f slope0 = first.slope(ray), slope1 = last.slope(ray);
  const auto at = [&](float fraction) {
    const float above = fraction_above(level0 + fraction * (level1 - level0),
                                       Eigen::Vector2f(slope0 + fraction * (slope1 - slope0)));
    const float in_group = s.group_above ? above : 1 - above;
    return in_group * (from.group + fraction * (to.group - from.group)) +
           (1 - in_group) * (from.other + fraction * (to.other - from.other));
  };
  if (ratio(at(0), p.luminance) > kLargestMisfit || ratio(at(1), q.luminance) > kLargestMisfit) return false;
  // The border touches the pixel from `enters` to `leaves`, where the slope of the luminance changes.
  const float reach = 0.25F * (slope0 + slope1).cwiseAbs().sum(), motion = level1 - level0;
  if (!(std::abs(motion) > 1e-3F * reach)) return false;
  const float one = (-reach - level0) / motion, two = (reach - level0) / motion;
  const float enters = std::clamp(std::min(one, two), 0.0F, 1.0F),
              leaves = std::clamp(std::max(one, two), 0.0F, 1.0F);
  for (int k = 0; k <= intervals; ++k) {
    const float fraction = enters + (leaves - enters) * static_cast<float>(k) / static_cast<float>(intervals);
    if (fraction > curve.time[curve.knots - 1] && fraction < 1) curve.add(fraction, at(fraction));
  }
  return true;
}

}  // namespace

float LuminanceCurve::integral(double open, double close) const {
  double sum = 0;
  for (int k = 0; k + 1 < knots; ++k) {
    const double a = std::max<double>(open, time[k]), b = std::min<double>(close, time[k + 1]);
    if (!(a < b)) continue;
    const double middle = (0.5 * (a + b) - time[k]) / (time[k + 1] - time[k]);
    sum += (b - a) * (luminance[k] + middle * (luminance[k + 1] - luminance[k]));
  }
  return static_cast<float>(sum);
}

LuminanceCurve luminance_curve(const CurveContext& c, const PixelSample& p, const PixelSample& q,
                               const TilePlan& plan, int x, int y) {
  LuminanceCurve curve;
  curve.add(0, p.luminance);
  const float change = ratio(p.luminance, q.luminance);
  const int column = plan.tile.x0 + x, row = plan.tile.y0 + y;
  const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
  if (nearly_equal(p, q)) {
    // A straight line is good enough.
  } else if (has_border(p) || has_border(q)) {
    add_border_knots(c, p, q, c.sampler.ray(column, row), change > kLargeChange ? 8 : 4, curve);
  } else if (plan.pixel[i] == PixelClass::flat && plan.patch[i] >= 0 && change > kModerateChange) {
    const int step = change > kLargeChange ? 1 : 2;
    for (int k = step; k < 4; k += step)
      curve.add(0.25F * static_cast<float>(k),
                c.sampler.flat_luminance(c.at_quarter(k), plan.patch[i], column, row));
  }
  curve.add(1, q.luminance);
  return curve;
}

}  // namespace evpose::sim
