// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <vector>

#include "evpose/sim/world/random.h"

namespace evpose::sim {

// Building blocks of a trajectory: smooth curves in space, in metres, and their timing.

using Curve = std::function<Eigen::Vector3d(double)>;

/// Largest speed in 0 .. duration, m/s, where the curve's parameter is time.
double peak_speed(const Curve& position, double duration_s);

/// The curve traversed as curve(pace * t), with `pace` such that the peak speed is the given one.
Curve with_peak_speed(Curve curve, double speed_m_s, double duration_s);

/// The curve traversed at constant speed from parameter 0, tabulated for the duration; stops at `end`.
Curve at_constant_speed(const Curve& curve, double speed_m_s, double duration_s, double end);

/// A sum of slow sines of random frequency and phase in each axis; root mean square about 1 in each.
Curve random_waves(Random& random, double low_hz, double high_hz);

/// A sine in each axis with the given amplitudes and frequency ratios.
Curve lissajous(const Eigen::Vector3d& half, const Eigen::Vector3d& ratio, Random& random);

/// A rounded square in the y-z plane whose size grows from a quarter of the volume to all of it and back.
Curve square_spiral(const Eigen::Vector3d& half, Random& random);

/// Minimum-jerk transition from 0 to 1.
double minimum_jerk(double u);

/// Moving average over +-half_width knots, applied twice; rounds corners. Values beyond the ends repeat the
/// end.
template <class T>
std::vector<T> smooth(std::vector<T> values, std::ptrdiff_t half_width) {
  const auto count = static_cast<std::ptrdiff_t>(values.size());
  for (int pass = 0; pass < 2; ++pass) {
    const auto at = [&](std::ptrdiff_t k) -> const T& {
      return values[static_cast<std::size_t>(std::clamp(k, std::ptrdiff_t{0}, count - 1))];
    };
    std::vector<T> out(values.size(), values[0]);
    // Each sum is computed afresh: a running sum would accumulate rounding errors.
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
