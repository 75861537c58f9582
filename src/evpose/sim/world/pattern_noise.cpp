// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/pattern_noise.h"

#include <algorithm>

namespace evpose::sim {
namespace {

double ease(double a) { return a * a * (3 - 2 * a); }

struct Lattice {
  int low, high;  // neighbours, wrapped
  double rest;
};
Lattice lattice(double x, int count) {
  double round = x - count * std::floor(x / count);
  if (round >= count) round = 0;  // by rounding
  const int low = static_cast<int>(round);
  return {low, low + 1 == count ? 0 : low + 1, round - low};
}

int cells(double length_m, double cell_m) {
  return std::max(1, static_cast<int>(std::lround(length_m / cell_m)));
}

}  // namespace

Noise::Noise(const Repeat& repeat, double cell_u_m, double cell_v_m, std::uint64_t seed)
    : columns_(cells(repeat.width_m, cell_u_m)),
      rows_(cells(repeat.height_m, cell_v_m)),
      per_u_(columns_ / repeat.width_m),
      per_v_(rows_ / repeat.height_m),
      values_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {
  Random random(seed, 0x4E6F697365);
  for (float& value : values_) value = static_cast<float>(random.uniform(-1, 1));
}

double Noise::operator()(double u_m, double v_m) const {
  const Lattice x = lattice(u_m * per_u_, columns_), y = lattice(v_m * per_v_, rows_);
  const float* const low = &values_[static_cast<std::size_t>(y.low) * static_cast<std::size_t>(columns_)];
  const float* const high = &values_[static_cast<std::size_t>(y.high) * static_cast<std::size_t>(columns_)];
  const double a = ease(x.rest), b = ease(y.rest);
  const double below = low[x.low] + a * (low[x.high] - low[x.low]);
  const double above = high[x.low] + a * (high[x.high] - high[x.low]);
  return below + b * (above - below);
}

Spots::Spots(const Repeat& repeat, double cell_m, double density, std::uint64_t seed)
    : columns_(cells(repeat.width_m, cell_m)),
      rows_(cells(repeat.height_m, cell_m)),
      per_u_(columns_ / repeat.width_m),
      per_v_(rows_ / repeat.height_m) {
  Random random(seed, 0x53706F7473);
  for (int i = 0; i < columns_ * rows_; ++i) {
    const double radius = random.uniform(0.12, 0.48);
    Spot spot{};
    spot.u = static_cast<float>(random.uniform(radius, 1 - radius));
    spot.v = static_cast<float>(random.uniform(radius, 1 - radius));
    const double tone = random.uniform(-1, 1);
    const bool there = random.uniform() < density;
    spot.radius_squared = there ? static_cast<float>(radius * radius) : -1;
    spot.tone = static_cast<float>(tone);
    spots_.push_back(spot);
  }
}

double Spots::operator()(double u_m, double v_m) const {
  const Lattice x = lattice(u_m * per_u_, columns_), y = lattice(v_m * per_v_, rows_);
  const Spot& spot = spots_[static_cast<std::size_t>(y.low) * static_cast<std::size_t>(columns_) +
                            static_cast<std::size_t>(x.low)];
  const double du = x.rest - spot.u, dv = y.rest - spot.v;
  return du * du + dv * dv < spot.radius_squared ? spot.tone : 0;
}

bool letter_ink(double x, double y, std::uint64_t letter) {
  if (x < 0 || x >= 0.8 || y < 0.1 || y >= 0.9) return false;
  // Strokes of a 3 x 5 raster: uprights at the sides, bars at three heights.
  const int column = static_cast<int>(x / 0.8 * 5), row = static_cast<int>((y - 0.1) / 0.8 * 7);
  const std::uint64_t bits = mix(letter + 0x6C65747472);
  if (column == 0) return (bits >> (row / 4) & 5) != 0;
  if (column == 4) return (bits >> (4 + row / 4) & 3) != 0;
  if (row == 0) return (bits & 0x100) != 0;
  if (row == 3) return (bits & 0x200) != 0;
  if (row == 6) return (bits & 0xC00) != 0;
  return column == 2 && (bits & 0x7000) == 0;
}

bool words_ink(double x_m, double y, double letter_m, std::uint64_t seed) {
  const double place = std::floor(x_m / letter_m);
  const auto index = static_cast<std::int64_t>(place);
  if (cell_value(index, 3, seed) < 0.18) return false;  // between words
  return letter_ink(x_m / letter_m - place, y, mix(seed + static_cast<std::uint64_t>(index)));
}

}  // namespace evpose::sim
