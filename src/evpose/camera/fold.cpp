// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/fold.h"

#include <numbers>

namespace evpose {

double fold_angle(const std::function<double(double)>& growth, double end_rad) {
  constexpr double kStep = 0.1 * std::numbers::pi / 180;  // about a pixel: no dip that is narrower matters
  double inside = 0, outside = kStep;
  while (outside < end_rad && growth(outside) > 0) {
    inside = outside;
    outside += kStep;
  }
  if (outside >= end_rad) {
    if (growth(end_rad) > 0) return end_rad;
    outside = end_rad;
  }
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (inside + outside);
    (growth(middle) > 0 ? inside : outside) = middle;
  }
  return inside;
}

}  // namespace evpose
