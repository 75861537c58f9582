// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <numbers>

namespace evpose::map_build {

/// The normal distribution and its integral from a table: they are asked for millions of times.
class Normal {
 public:
  Normal() {
    for (int k = 0; k <= kCells; ++k) {
      const double x = (k - 0.5 * kCells) / kPerUnit;
      density_[static_cast<std::size_t>(k)] = std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
      below_[static_cast<std::size_t>(k)] = 0.5 * std::erfc(-x / std::numbers::sqrt2);
    }
  }
  double density(double x) const { return interpolate(density_, x, 0, 0); }
  double below(double x) const { return interpolate(below_, x, 0, 1); }
  /// Integral of below() from minus infinity.
  double ramp(double x) const { return x * below(x) + density(x); }

 private:
  static constexpr int kPerUnit = 128, kCells = 14 * kPerUnit;
  using Table = std::array<double, kCells + 1>;
  static double interpolate(const Table& table, double x, double low, double high) {
    const double at = x * kPerUnit + 0.5 * kCells;
    if (!(at > 0)) return low;
    if (at >= kCells) return high;
    const auto k = static_cast<std::size_t>(at);
    const double share = at - static_cast<double>(k);
    return table[k] + share * (table[k + 1] - table[k]);
  }
  Table density_{}, below_{};
};

inline const Normal& normal() {
  static const Normal table;
  return table;
}

}  // namespace evpose::map_build
