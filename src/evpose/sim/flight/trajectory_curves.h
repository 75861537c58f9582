// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <vector>

#include "evpose/sim/world/random.h"

namespace evpose::sim {

// What the ways of a trajectory are made of: smooth curves in space, metres, and how they are travelled.

using Curve = std::function<Eigen::Vector3d(double)>;

/// Largest speed in 0 .. duration, m/s, where the curve's parameter is time.
double fastest(const Curve& position, double duration_s);

/// Travels a curve so fast that its fastest moment has the speed: curve(pace * t).
Curve at_top_speed(Curve curve, double speed_m_s, double duration_s);

/// Travels a curve at constant speed from parameter 0. Tabulated over what the duration needs; holds at
/// `end`.
Curve at_constant_speed(const Curve& curve, double speed_m_s, double duration_s, double end);

/// Some slow waves of random frequency and phase in each axis; root mean square about 1 in each.
Curve random_waves(Random& random, double low_hz, double high_hz);

/// A sine in each axis, of these amplitudes and ratios of frequency.
Curve lissajous(const Eigen::Vector3d& half, const Eigen::Vector3d& ratio, Random& random);

/// Turns of a rounded square across x that grow from a quarter of the volume to all of it and back.
Curve square_spiral(const Eigen::Vector3d& half, Random& random);

/// Least jerk from 0 to 1.
double ease(double u);

/// Mean over +-half_width knots, twice: rounds corners. The ends are held.
template <class T>
std::vector<T> smooth(std::vector<T> values, std::ptrdiff_t half_width) {
  const auto count = static_cast<std::ptrdiff_t>(values.size());
  for (int pass = 0; pass < 2; ++pass) {
    const auto at = [&](std::ptrdiff_t k) -> const T& {
      return values[static_cast<std::size_t>(std::clamp(k, std::ptrdiff_t{0}, count - 1))];
    };
    std::vector<T> out(values.size(), values[0]);
    // Sums are made anew for each value: a running one would remember its rounding.
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      T sum = at(k - half_width);
      for (std::ptrdiff_t j = k - half_width + 1; j <= k + half_width; ++j) sum += at(j);
      out[static_cast<std::size_t>(k)] = sum / static_cast<double>(2 * half_width + 1);
    }
    values = std::move(out);
  }
  return values;
}

}  // namespace evpose::sim
