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
bool group_luminance(const PixelSample& s, const PixelSample& at, GroupLuminance& out) {
  const BorderSample &border = s.border, &own = at.border;
  out = {border.group_luminance, border.other_luminance};
  if (own.other >= 0 || (own.other == kSky && at.group >= 0)) {
    if (at.group == s.group && own.other == border.other)
      out = {own.group_luminance, own.other_luminance};
    else if (at.group == border.other && own.other == s.group)
      out = {own.other_luminance, own.group_luminance};
    else
      return false;
    return true;
  }
  if (own.other != kNone) return false;
  if (at.group == s.group)
    out.group = at.luminance;
  else if (at.group == border.other)
    out.other = at.luminance;
  else
    return false;
  return true;
}

// Adds the knots between the ends, none if the border does not explain the two samples.
void add_border_knots(const PreparedScene& prepared, const SceneView& view0, const SceneView& view1,
                      const PixelRay& ray, const PixelSample& p, const PixelSample& q,
                      LuminanceCurve& curve) {
  const int intervals = ratio(p.luminance, q.luminance) > kLargeChange ? 8 : 4;
  const PixelSample& s = has_border(q) ? q : p;
  GroupLuminance from{}, to{};
  if (!group_luminance(s, p, from) || !group_luminance(s, q, to)) return;
  const Border first = border_of(prepared, view0, s.border), last = border_of(prepared, view1, s.border);
  const float level0 = first.level(ray), level1 = last.level(ray);
  const Eigen::Vector2f slope0 = first.slope(ray), slope1 = last.slope(ray);
  const auto at = [&](float fraction) {
    const float above = fraction_above(level0 + fraction * (level1 - level0),
                                       Eigen::Vector2f(slope0 + fraction * (slope1 - slope0)));
    const float in_group = s.border.group_above ? above : 1 - above;
    return in_group * (from.group + fraction * (to.group - from.group)) +
           (1 - in_group) * (from.other + fraction * (to.other - from.other));
  };
  if (ratio(at(0), p.luminance) > kLargestMisfit || ratio(at(1), q.luminance) > kLargestMisfit) return;
  // The border touches the pixel from `enters` to `leaves`, where the slope of the luminance changes.
  const float reach = 0.25F * (slope0 + slope1).cwiseAbs().sum(), motion = level1 - level0;
  if (!(std::abs(motion) > 1e-3F * reach)) return;
  const float one = (-reach - level0) / motion, two = (reach - level0) / motion;
  const float enters = std::clamp(std::min(one, two), 0.0F, 1.0F),
              leaves = std::clamp(std::max(one, two), 0.0F, 1.0F);
  for (int k = 0; k <= intervals; ++k) {
    const float fraction = enters + (leaves - enters) * static_cast<float>(k) / static_cast<float>(intervals);
    if (fraction > curve.time[curve.knots - 1] && fraction < 1) curve.add(fraction, at(fraction));
  }
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

int texture_samples_between(float p, float q) {
  const float change = ratio(p, q);
  return change > kLargeChange ? 3 : change > kModerateChange ? 1 : 0;
}

LuminanceCurve border_curve(const PreparedScene& prepared, const SceneView& from, const SceneView& to,
                            const PixelRay& ray, const PixelSample& p, const PixelSample& q) {
  LuminanceCurve curve;
  curve.add(0, p.luminance);
  add_border_knots(prepared, from, to, ray, p, q, curve);
  curve.add(1, q.luminance);
  return curve;
}

}  // namespace evpose::sim
