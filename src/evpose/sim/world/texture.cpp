// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/texture.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

constexpr float kWhite = 65535;
/// Largest number of samples along the footprint at a grazing angle. Beyond it the footprint is widened
/// across.
constexpr int kMostTaps = 8;

int wrapped(int i, int n) { return i >= n ? i - n : i; }

}  // namespace

Texture::Texture(double width_m, double height_m, double texel_m, const Pattern& pattern)
    : width_(static_cast<float>(width_m)), height_(static_cast<float>(height_m)) {
  EVPOSE_CHECK(width_m > 0 && height_m > 0 && texel_m > 0);
  // Whole numbers of texels: the rectangle repeats without a cut texel.
  Level level{std::max(1, static_cast<int>(std::lround(width_m / texel_m))),
              std::max(1, static_cast<int>(std::lround(height_m / texel_m))),
              {}};
  texel_ = static_cast<float>(texel_m);
  const double step_u = width_m / level.columns, step_v = height_m / level.rows;
  level.values.reserve(static_cast<std::size_t>(level.columns) * level.rows);
  for (int row = 0; row < level.rows; ++row) {
    for (int column = 0; column < level.columns; ++column) {
      const double value = std::clamp(pattern((column + 0.5) * step_u, (row + 0.5) * step_v), 0.0, 1.0);
      level.values.push_back(static_cast<std::uint16_t>(std::lround(value * kWhite)));
    }
  }
  levels_.push_back(std::move(level));
  while (levels_.back().columns > 1 || levels_.back().rows > 1) {
    const Level& fine = levels_.back();
    Level coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
    coarse.values.reserve(static_cast<std::size_t>(coarse.columns) * coarse.rows);
    // Halving an odd length would shift the texture, hence the mean over the exact span.
    const double ratio_u = static_cast<double>(fine.columns) / coarse.columns,
                 ratio_v = static_cast<double>(fine.rows) / coarse.rows;
    const auto spans = [](int i, double ratio, int n, int* first, double* weights) {
      const double low = i * ratio, high = low + ratio;
      *first = static_cast<int>(low);
      int count = 0;
      for (int k = *first; k < n && k < high - 1e-9; ++k)
        weights[count++] = std::min(high, k + 1.0) - std::max(low, static_cast<double>(k));
      return count;
    };
    for (int row = 0; row < coarse.rows; ++row) {
      int first_row = 0, first_column = 0;
      double by_row[4], by_column[4];
      const int rows = spans(row, ratio_v, fine.rows, &first_row, by_row);
      for (int column = 0; column < coarse.columns; ++column) {
        const int columns = spans(column, ratio_u, fine.columns, &first_column, by_column);
        double sum = 0, weight = 0;
        for (int j = 0; j < rows; ++j) {
          for (int i = 0; i < columns; ++i) {
            const double w = by_row[j] * by_column[i];
            sum += w * fine.values[static_cast<std::size_t>(first_row + j) * fine.columns + first_column + i];
            weight += w;
          }
        }
        coarse.values.push_back(static_cast<std::uint16_t>(std::lround(sum / weight)));
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

// Bilinear; (u, v) as fractions of the rectangle, in [0, 1).
float Texture::sample(const Level& level, float u, float v) const {
  const auto columns = static_cast<float>(level.columns), rows = static_cast<float>(level.rows);
  float x = u * columns - 0.5f, y = v * rows - 0.5f;
  if (x < 0) x += columns;
  if (y < 0) y += rows;
  const int i = std::min(static_cast<int>(x), level.columns - 1),
            j = std::min(static_cast<int>(y), level.rows - 1);
  const float a = x - static_cast<float>(i), b = y - static_cast<float>(j);
  const int right = wrapped(i + 1, level.columns);
  const std::uint16_t* low = &level.values[static_cast<std::size_t>(j) * level.columns];
  const std::uint16_t* high =
      &level.values[static_cast<std::size_t>(wrapped(j + 1, level.rows)) * level.columns];
  const auto mix = [a](float from, float to) { return from + a * (to - from); };
  const float bottom = mix(low[i], low[right]);
  const float top = mix(high[i], high[right]);
  return bottom + b * (top - bottom);
}

float Texture::mean(float u_m, float v_m, const Eigen::Vector2f& a_m, const Eigen::Vector2f& b_m) const {
  // Principal axes of the parallelogram: of the matrix [a b], as those of its second moment.
  const float uu = a_m.x() * a_m.x() + b_m.x() * b_m.x(), vv = a_m.y() * a_m.y() + b_m.y() * b_m.y(),
              uv = a_m.x() * a_m.y() + b_m.x() * b_m.y();
  const float half_trace = 0.5f * (uu + vv), half_difference = 0.5f * (uu - vv);
  const float root = std::sqrt(half_difference * half_difference + uv * uv);
  const float major = std::sqrt(half_trace + root), minor = std::sqrt(std::max(half_trace - root, 0.0f));
  int taps = 1;
  float across = std::max(minor, texel_);
  if (major > 1.2f * across) {
    taps = std::min(kMostTaps, static_cast<int>(std::ceil(major / across)));
    across = std::max(across, major / static_cast<float>(taps));
  }
  // Mipmap level and weight of the next one: a footprint of 2^k (1 + f) texels blends f of level k + 1 into
  // k.
  int exponent = 0;
  const float mantissa = 2 * std::frexp(across / texel_, &exponent);
  const int last = static_cast<int>(levels_.size()) - 1;
  const int fine = std::min(exponent - 1, last), coarse = std::min(fine + 1, last);
  const float blend = fine < last ? mantissa - 1 : 0;
  // Unit vector along the major axis.
  Eigen::Vector2f axis(root + half_difference, uv);
  if (half_difference < 0) axis = {uv, root - half_difference};
  const float length = axis.norm();
  axis = length > 0 ? Eigen::Vector2f(axis / length) : Eigen::Vector2f(1, 0);
  const float step = major / static_cast<float>(taps);
  float sum = 0;
  for (int i = 0; i < taps; ++i) {
    const float along = (static_cast<float>(i) + 0.5f) * step - 0.5f * major;
    float u = (u_m + along * axis.x()) / width_, v = (v_m + along * axis.y()) / height_;
    u -= std::floor(u);
    v -= std::floor(v);
    const float at_fine = sample(levels_[fine], u, v);
    sum += blend > 0 ? at_fine + blend * (sample(levels_[coarse], u, v) - at_fine) : at_fine;
  }
  return sum / (kWhite * static_cast<float>(taps));
}

std::size_t Texture::bytes() const {
  std::size_t sum = 0;
  for (const Level& level : levels_) sum += level.values.size() * sizeof(std::uint16_t);
  return sum;
}

}  // namespace evpose::sim
