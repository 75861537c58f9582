// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/edge_delay.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

/// Mean place of the events in the pixel, 0 to 1, for a step of `steps` thresholds whose luminance goes by
/// the factor exp(sign * y) as the logarithm has moved by y. With the density g(y) of events over y, which is
/// y / threshold^2 up to the threshold and 1 / threshold beyond, the place is the mean over g of
///   (exp(sign y) - 1) / (exp(sign h) - 1), h the height of the step.
double mean_place(double steps, double threshold, int sign) {
  const double height = steps * threshold, ramp = std::min(height, threshold);
  // Integrals of y exp(sign y) over the ramp and of exp(sign y) beyond it.
  const double rising = 1 + std::exp(sign * ramp) * (sign * ramp - 1);
  const double level = sign * (std::exp(sign * height) - std::exp(sign * ramp));
  const double events = expected_events(steps);
  const double weighed = rising / (threshold * threshold) + level / threshold;
  return (weighed - events) / (events * std::expm1(sign * height));
}

}  // namespace

double expected_events(double thresholds) {
  return thresholds < 1 ? 0.5 * thresholds * thresholds : thresholds - 0.5;
}

double step_of_events(double events) { return events < 0.5 ? std::sqrt(2 * events) : events + 0.5; }

EdgeDelay edge_delay(double thresholds, double threshold) {
  constexpr double kLeastSteps = 0.05;  // below, rounding counts
  const double steps = std::max(thresholds, kLeastSteps);
  return {mean_place(steps, threshold, 1) - 0.5, mean_place(steps, threshold, -1) - 0.5};
}

EdgeDelayTable::EdgeDelayTable(double threshold) : threshold_(threshold) {
  for (std::size_t i = 0; i < values_.size(); ++i)
    values_[i] = edge_delay(static_cast<double>(i) / kPerThreshold, threshold);
}

EdgeDelay EdgeDelayTable::operator()(double thresholds) const {
  const double place = thresholds * kPerThreshold;
  const auto low = static_cast<std::size_t>(place);
  if (low + 1 >= values_.size()) return edge_delay(thresholds, threshold_);
  const double rest = place - static_cast<double>(low);
  const EdgeDelay &a = values_[low], &b = values_[low + 1];
  return {a.on_px + rest * (b.on_px - a.on_px), a.off_px + rest * (b.off_px - a.off_px)};
}

}  // namespace evpose
