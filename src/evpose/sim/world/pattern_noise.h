// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "evpose/sim/world/patterns.h"
#include "evpose/sim/world/random.h"

// Building blocks of patterns. All are periodic over the Repeat of the pattern.
namespace evpose::sim {

/// In [0, 1), fixed for a pair of whole numbers.
inline double cell_value(std::int64_t i, std::int64_t j, std::uint64_t seed) {
  const std::uint64_t key = static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15u +
                            static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4Fu;
  return static_cast<double>(mix(key ^ seed * 0xD6E8FEB86659FD93u) >> 11) * 0x1p-53;
}

/// Equal cells, about `wanted_m` long, that fill `length_m` and repeat.
struct CellRow {
  double size_m;
  int count;

  CellRow(double length_m, double wanted_m)
      : size_m(length_m / std::fmax(1, std::round(length_m / wanted_m))),
        count(static_cast<int>(std::lround(length_m / size_m))) {}
  struct Cell {
    int index;        ///< 0 to count - 1
    double offset_m;  ///< from the cell's start
  };
  Cell at(double x_m) const {
    const double place = x_m / size_m;
    double round = place - count * std::floor(place / count);
    if (round >= count) round = 0;  // by rounding
    const int index = static_cast<int>(round);
    return {index, (round - index) * size_m};
  }
};

/// Smooth random values in [-1, 1] with cells of about the given size.
class Noise {
 public:
  Noise(const Repeat& repeat, double cell_u_m, double cell_v_m, std::uint64_t seed);
  Noise(const Repeat& repeat, double cell_m, std::uint64_t seed) : Noise(repeat, cell_m, cell_m, seed) {}
  double operator()(double u_m, double v_m) const;

 private:
  int columns_, rows_;
  double per_u_, per_v_;
  std::vector<float> values_;
};

/// Randomly placed discs, at most one in each cell of a grid, of random size and tone.
class Spots {
 public:
  /// `density`: fraction of the cells that have one.
  Spots(const Repeat& repeat, double cell_m, double density, std::uint64_t seed);
  /// Tone in [-1, 1] of the disc at the place; 0 where there is none.
  double operator()(double u_m, double v_m) const;

 private:
  struct Spot {
    float u, v, radius_squared, tone;  // in cells
  };
  int columns_, rows_;
  double per_u_, per_v_;
  std::vector<Spot> spots_;
};

/// True where a random letter has ink; x, y in [0, 1] over the letter, y up.
bool letter_ink(double x, double y, std::uint64_t letter);
/// True where a line of random words has ink. `x_m` along it, `y` in [0, 1] over its letters' height.
bool words_ink(double x_m, double y, double letter_m, std::uint64_t seed);

}  // namespace evpose::sim
