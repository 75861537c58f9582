// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/shared_errors.h"

#include <cmath>
#include <numbers>

#include "evpose/fusion/joint_measurement.h"

namespace evpose {
namespace {

// Of one sigma; docs/decisions/tracking.md has what they were chosen on.
constexpr double kDelay_s = 2e-3, kOffset_px = 0.08;
constexpr double kOfMap = 3;  // the offset of a built map's contours, in sigmas that the map states
// Texture beside the contours moves along with them: the fewer events are of contours, the further it draws
// their mean. Concentrations on which the offsets were chosen, of true contours and of a built map's.
constexpr double kClear = 0.6, kClearOfMap = 0.75;
constexpr double kLeastConcentration = 0.15;

/// By how much the offset of a filter's update is larger than at the concentration `clear`.
double by_clutter(double concentration, double clear) {
  const auto clutter = [](double share) { return (1 - share) / std::max(share, kLeastConcentration); };
  return concentration > 0 ? std::max(1.0, clutter(concentration) / clutter(clear)) : 1;
}

int direction_of(const Eigen::Vector2d& normal_px) {
  constexpr double kWidth_rad = 2 * std::numbers::pi / SharedErrors::kDirections;
  const auto turns = static_cast<int>(std::lround(std::atan2(normal_px.y(), normal_px.x()) / kWidth_rad));
  return (turns + SharedErrors::kDirections) % SharedErrors::kDirections;
}

}  // namespace

std::array<SharedErrors::Effect, 2> SharedErrors::on(const ContourOffset& contour) {
  const int side = contour.darker < 0 ? -1 : 1;
  const double offset_px = std::hypot(kOffset_px, kOfMap * contour.sigma_m * contour.across_body.norm());
  return {
      {{0, kDelay_s * contour.speed_px_s}, {1 + direction_of(side * contour.normal_px), side * offset_px}}};
}

void SharedErrors::add(const ContourOffset& contour, const BlockSample& sample,
                       JointMeasurement& measurement) {
  const auto [delay, offset] = on(contour);
  measurement.add_shared_error(delay.number, delay.px, sample);
  const double clear = contour.sigma_m > 0 ? kClearOfMap : kClear;
  measurement.add_shared_error(offset.number, by_clutter(contour.concentration, clear) * offset.px, sample);
}

}  // namespace evpose
