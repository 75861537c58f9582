// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/texture.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

constexpr double kLevels = 255;

// The box [centre - size / 2, centre + size / 2] in texels, at least one wide, inside [0, count].
std::pair<double, double> cut(double centre, double size, int count) {
  const double half = 0.5 * std::max(size, 1.0);
  const double middle = std::clamp(centre, 0.5, count - 0.5);
  return {std::max(0.0, middle - half), std::min(static_cast<double>(count), middle + half)};
}

// Texel border below a coordinate in [0, count], and the rest.
struct Place {
  int index;
  double rest;
};
Place place(double x, int count) {
  const int index = std::min(static_cast<int>(x), count - 1);
  return {index, x - index};
}

}  // namespace

Texture::Texture(double width_m, double height_m, double texel_m,
                 const std::function<double(double, double)>& reflectance)
    : columns_(std::max(1, static_cast<int>(std::lround(width_m / texel_m)))),
      rows_(std::max(1, static_cast<int>(std::lround(height_m / texel_m)))),
      texels_per_m_u_(columns_ / width_m),
      texels_per_m_v_(rows_ / height_m) {
  EVPOSE_CHECK(columns_ * kLevels * rows_ < 0x1p31);
  const std::size_t stride = columns_ + 1;
  sums_.assign(stride * (rows_ + 1), 0);
  for (int y = 0; y < rows_; ++y) {
    std::int32_t row_sum = 0;
    for (int x = 0; x < columns_; ++x) {
      const double value = reflectance((x + 0.5) / texels_per_m_u_, (y + 0.5) / texels_per_m_v_);
      row_sum += static_cast<std::int32_t>(std::lround(kLevels * std::clamp(value, 0.0, 1.0)));
      sums_[(y + 1) * stride + x + 1] = sums_[y * stride + x + 1] + row_sum;
    }
  }
}

double Texture::mean(double u_m, double v_m, double width_m, double height_m) const {
  const auto [x0, x1] = cut(u_m * texels_per_m_u_, width_m * texels_per_m_u_, columns_);
  const auto [y0, y1] = cut(v_m * texels_per_m_v_, height_m * texels_per_m_v_, rows_);
  const Place left = place(x0, columns_), right = place(x1, columns_);
  const Place low = place(y0, rows_), high = place(y1, rows_);
  // Sum over [x0, x1] x [0, y] for whole y; linear between, as the texels are even.
  const auto sum_below = [&](int y) {
    const std::int32_t* row = &sums_[static_cast<std::size_t>(y) * (columns_ + 1)];
    const std::int32_t *l = row + left.index, *r = row + right.index;
    return (r[0] - l[0]) + (r[1] - r[0]) * right.rest - (l[1] - l[0]) * left.rest;
  };
  const double below_low = sum_below(low.index), below_high = sum_below(high.index);
  const double total = (below_high - below_low) + (sum_below(high.index + 1) - below_high) * high.rest -
                       (sum_below(low.index + 1) - below_low) * low.rest;
  return total / (kLevels * (x1 - x0) * (y1 - y0));
}

}  // namespace evpose::sim
