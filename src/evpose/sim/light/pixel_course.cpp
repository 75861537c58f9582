// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/pixel_course.h"

#include <algorithm>
#include <cmath>

namespace evpose::sim {
namespace {

// Changes of luminance, as ratios, from which more pieces are needed: event times are then good to a
// hundredth of a pixel of motion.
constexpr float kSome = 1.12F, kMuch = 1.35F;
// A border that does not give back the samples at the two ends is not the whole story.
constexpr float kFit = 1.1F;

float ratio(float a, float b) { return a > b ? a / b : b / a; }

struct Own {
  float group, other;
};

// Luminance of the border's two groups at one end, from a sample there; what the sample does not show is
// taken from the other end.
bool own_luminance(const PixelSample& border, const PixelSample& at, Own& out) {
  out = {border.of_group, border.of_other};
  if (at.other >= 0 || (at.other == kSky && at.group >= 0)) {
    if (at.group == border.group && at.other == border.other)
      out = {at.of_group, at.of_other};
    else if (at.group == border.other && at.other == border.group)
      out = {at.of_other, at.of_group};
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

// Adds the knots between the ends.
bool follow_border(const CourseContext& c, const PixelSample& p, const PixelSample& q, const PixelRay& ray,
                   int pieces, Course& course) {
  const PixelSample& s = has_border(q) ? q : p;
  Own from{}, to{};
  if (!own_luminance(s, p, from) || !own_luminance(s, q, to)) return false;
  const Border first = border_of(c.stage, c.from, s), last = border_of(c.stage, c.to, s);
  const float level0 = first.level(ray), level1 = last.level(ray);
  const Eigen::Vector2f slope0 = first.slope(ray), slope1 = last.slope(ray);
  const auto at = [&](float share) {
    const float above =
        share_above(level0 + share * (level1 - level0), Eigen::Vector2f(slope0 + share * (slope1 - slope0)));
    const float in_group = s.group_above ? above : 1 - above;
    return in_group * (from.group + share * (to.group - from.group)) +
           (1 - in_group) * (from.other + share * (to.other - from.other));
  };
  if (ratio(at(0), p.luminance) > kFit || ratio(at(1), q.luminance) > kFit) return false;
  // The border touches the pixel from `enters` to `leaves`: there luminance turns, so that knots belong
  // there.
  const float reach = 0.25F * (slope0 + slope1).cwiseAbs().sum(), motion = level1 - level0;
  if (!(std::abs(motion) > 1e-3F * reach)) return false;
  const float one = (-reach - level0) / motion, two = (reach - level0) / motion;
  const float enters = std::clamp(std::min(one, two), 0.0F, 1.0F),
              leaves = std::clamp(std::max(one, two), 0.0F, 1.0F);
  for (int k = 0; k <= pieces; ++k) {
    const float share = enters + (leaves - enters) * static_cast<float>(k) / static_cast<float>(pieces);
    if (share > course.time[course.knots - 1] && share < 1) course.add(share, at(share));
  }
  return true;
}

}  // namespace

float Course::integral(double open, double close) const {
  double sum = 0;
  for (int k = 0; k + 1 < knots; ++k) {
    const double a = std::max<double>(open, time[k]), b = std::min<double>(close, time[k + 1]);
    if (!(a < b)) continue;
    const double middle = (0.5 * (a + b) - time[k]) / (time[k + 1] - time[k]);
    sum += (b - a) * (luminance[k] + middle * (luminance[k + 1] - luminance[k]));
  }
  return static_cast<float>(sum);
}

Course pixel_course(const CourseContext& c, const PixelSample& p, const PixelSample& q, const TilePlan& plan,
                    int x, int y) {
  Course course;
  course.add(0, p.luminance);
  const float change = ratio(p.luminance, q.luminance);
  const int column = plan.tile.x0 + x, row = plan.tile.y0 + y;
  const std::size_t i = static_cast<std::size_t>(y) * kTilePx + x;
  if (nearly_same(p, q)) {
    // nothing in between
  } else if (has_border(p) || has_border(q)) {
    follow_border(c, p, q, c.sampler.ray(column, row), change > kMuch ? 8 : 4, course);
  } else if (plan.pixel[i] == PixelClass::flat && plan.patch[i] >= 0 && change > kSome) {
    const int step = change > kMuch ? 1 : 2;
    for (int k = step; k < 4; k += step)
      course.add(0.25F * static_cast<float>(k),
                 c.sampler.flat_luminance(c.at_quarter(k), plan.patch[i], column, row));
  }
  course.add(1, q.luminance);
  return course;
}

}  // namespace evpose::sim
