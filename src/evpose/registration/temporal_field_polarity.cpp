// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/temporal_field_polarity.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

// Events are counted in a patch about the sample: so far along the contour to either side, and across it so
// far from where it was since the last update.
constexpr int kAlong_px = 2;
constexpr double kAcross_px = 1.5;
constexpr double kMostAcross_px = 8;  // of very long intervals, a part

}  // namespace

AngleTest test_angle(const ContourSample& s, int brighter_side, double buffer_sigma) {
  if (!(s.flow_px_s > 0)) return {0, 1};
  return {brighter_side * s.speed_px_s / s.flow_px_s, buffer_sigma * s.speed_sigma_px_s / s.flow_px_s};
}

FieldPolarity predicted_polarity(const ContourSample& s, const ContrastMemory& contrast,
                                 const PolarityConfig& config) {
  const double steps = s.normal_side * contrast.steps(s.segment);  // > 0: darker where the normal points
  const bool sign_known = contrast.known(s.segment) && std::abs(steps) >= ContrastMemory::kSureSteps;
  if (!config.on || !sign_known) return FieldPolarity::both;
  const AngleTest angle = test_angle(s, steps > 0 ? -1 : 1, config.buffer_sigma);
  if (!(std::abs(angle.cos_theta) > angle.buffer)) return FieldPolarity::both;
  return angle.cos_theta < 0 ? FieldPolarity::on : FieldPolarity::off;
}

SampleEvents events_at(const TimeSurface& surface, const ContourSample& s, std::uint32_t now_us,
                       double span_s) {
  SampleEvents out;
  const double way_px = s.speed_px_s * span_s;
  const Eigen::Vector2d along(-s.normal_px.y(), s.normal_px.x());
  const Eigen::Vector2d middle = s.pixel - 0.5 * way_px * s.normal_px;
  const int across = static_cast<int>(std::min(kAcross_px + 0.5 * std::abs(way_px), kMostAcross_px));
  const auto span_us = static_cast<std::uint32_t>(1e6 * span_s);
  const std::uint32_t since_us = now_us > span_us ? now_us - span_us : 0;
  for (int a = -kAlong_px; a <= kAlong_px; ++a)
    for (int d = -across; d <= across; ++d) {
      const Eigen::Vector2d at = middle + a * along + d * s.normal_px;
      const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
      if (x < 0 || y < 0 || x >= surface.width() || y >= surface.height()) continue;
      out.on += surface.last(x, y, Polarity::on) > since_us;
      out.off += surface.last(x, y, Polarity::off) > since_us;
    }
  out.swept_px2 = (2 * kAlong_px + 1) * std::abs(way_px);
  return out;
}

}  // namespace evpose
