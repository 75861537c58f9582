// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/patterns.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "evpose/sim/random.h"

namespace evpose::sim {
namespace {

// In [0, 1), fixed for a cell of a grid.
double cell_value(std::int64_t i, std::int64_t j, std::uint64_t seed) {
  const std::uint64_t key = mix(static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15u + seed);
  return static_cast<double>(mix(key + static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4Fu) >> 11) * 0x1p-53;
}

double ease(double a) { return a * a * (3 - 2 * a); }

// Value noise in [-1, 1] with cells of size one.
double noise(double x, double y, std::uint64_t seed) {
  const double i = std::floor(x), j = std::floor(y), a = ease(x - i), b = ease(y - j);
  const auto value = [&](int di, int dj) {
    return cell_value(static_cast<std::int64_t>(i) + di, static_cast<std::int64_t>(j) + dj, seed);
  };
  const double low = value(0, 0) * (1 - a) + value(1, 0) * a, high = value(0, 1) * (1 - a) + value(1, 1) * a;
  return 2 * (low * (1 - b) + high * b) - 1;
}

// Where a coordinate falls in a row of equal cells.
struct Cell {
  std::int64_t index;
  double offset_m;  // from the cell's start
};
Cell cell(double x_m, double size_m) {
  const double index = std::floor(x_m / size_m);
  return {static_cast<std::int64_t>(index), x_m - index * size_m};
}

bool within(double x, double low, double high) { return x >= low && x < high; }

struct Sheet {
  double left, bottom, width, height;  // metres
  double paper, ink;                   // reflectance
  std::uint64_t seed;
};

// Headline, picture and lines of words in blocks; negative where there is no ink.
double sheet_value(const Sheet& s, double u, double v) {
  const double x = (u - s.left) / s.width, y = (v - s.bottom) / s.height;
  if (!within(x, 0, 1) || !within(y, 0, 1)) return -1;
  if (!within(x, 0.06, 0.94) || !within(y, 0.05, 0.95)) return s.paper;
  if (y > 0.83) {  // headline: broad letters
    const Cell letter = cell(x * s.width, 0.07 * s.width);
    const double stroke = cell_value(letter.index, static_cast<std::int64_t>((y - 0.83) * 25), s.seed);
    return stroke > 0.45 && letter.offset_m < 0.055 * s.width ? s.ink : s.paper;
  }
  if (y > 0.45) {  // picture: soft shapes with hard rims
    const double shape = noise(x * 6, y * 7, s.seed + 1) + 0.5 * noise(x * 17, y * 19, s.seed + 2);
    return shape > 0.35 ? 0.5 * (s.ink + s.paper) : shape > -0.1 ? s.ink + 0.15 : 0.85 * s.paper;
  }
  const Cell line = cell(y * s.height, 0.022);
  if (line.offset_m > 0.012) return s.paper;
  const Cell word = cell(x * s.width + 0.05 * cell_value(line.index, 7, s.seed), 0.035);
  const double length = 0.012 + 0.02 * cell_value(line.index, word.index, s.seed + 3);
  return word.offset_m < length ? s.ink : s.paper;
}

}  // namespace

Pattern bricks(double mean, std::uint64_t seed) {
  return [=](double u, double v) {
    const Cell row = cell(v, 0.075);
    const Cell brick = cell(u + (row.index & 1 ? 0.12 : 0.0), 0.24);
    if (row.offset_m < 0.011 || brick.offset_m < 0.011)
      return 1.35 * mean + 0.03 * noise(u / 0.01, v / 0.01, seed);
    const double tone = 0.78 + 0.4 * cell_value(brick.index, row.index, seed);
    return mean *
           (tone + 0.12 * noise(u / 0.012, v / 0.012, seed + 1) + 0.1 * noise(u / 0.05, v / 0.03, seed + 2));
  };
}

Pattern tiles(double mean, double tile_m, std::uint64_t seed) {
  return [=](double u, double v) {
    const Cell i = cell(u, tile_m), j = cell(v, tile_m);
    if (i.offset_m < 0.008 || j.offset_m < 0.008) return 0.4 * mean;
    const double from_centre = std::abs(i.offset_m / tile_m - 0.5) + std::abs(j.offset_m / tile_m - 0.5);
    const double tone = 0.8 + 0.5 * cell_value(i.index, j.index, seed);
    const double inlay =
        from_centre < 0.22 ? (cell_value(i.index, j.index, seed + 1) > 0.5 ? 0.45 : 1.35) : 1.0;
    return mean * tone * (inlay + 0.1 * noise(u / 0.03, v / 0.03, seed + 2));
  };
}

Pattern planks(double mean, double plank_m, std::uint64_t seed) {
  return [=](double u, double v) {
    const Cell plank = cell(v, plank_m);
    const Cell board = cell(u + 3 * cell_value(plank.index, 1, seed), 1.3);
    if (plank.offset_m < 0.006 || board.offset_m < 0.006) return 0.35 * mean;
    const double tone = 0.75 + 0.5 * cell_value(board.index, plank.index, seed);
    const double grain = noise(u / 0.25, v / 0.009 + 2 * noise(u / 0.4, v / 0.1, seed + 1), seed + 2);
    const double knot = noise(u / 0.18, v / 0.06, seed + 3);
    return mean * tone * (1 + 0.28 * grain - (knot > 0.72 ? 0.4 : 0.0));
  };
}

Pattern plaster(double mean, std::uint64_t seed) {
  return [=](double u, double v) {
    const double stain = noise(u / 0.35, v / 0.35, seed) + 0.5 * noise(u / 0.11, v / 0.11, seed + 1);
    const double speckle =
        cell_value(cell(u, 0.014).index, cell(v, 0.014).index, seed + 2) > 0.985 ? -0.3 : 0.0;
    return mean * (1 + 0.1 * stain + 0.05 * noise(u / 0.02, v / 0.02, seed + 3) + speckle);
  };
}

Pattern cloth(double mean, std::uint64_t seed) {
  return [=](double u, double v) {
    const Cell i = cell(u, 0.09), j = cell(v, 0.09);
    const bool stripe = i.offset_m < 0.018 || j.offset_m < 0.018;
    const bool thread = within(i.offset_m, 0.045, 0.052) != within(j.offset_m, 0.045, 0.052);
    const double tone = ((i.index + j.index) & 1) != 0 ? 1.15 : 0.85;
    return mean *
           (tone * (stripe ? 0.55 : 1.0) * (thread ? 1.4 : 1.0) + 0.08 * noise(u / 0.01, v / 0.01, seed));
  };
}

Pattern posters(Pattern base, double width_m, double height_m, std::uint64_t seed) {
  std::vector<Sheet> sheets;
  Random random(seed);
  for (double left = 0.25; left < width_m - 0.7;) {
    Sheet s{};
    s.width = random.uniform(0.4, 0.75);
    s.height = s.width * random.uniform(1.2, 1.5);
    s.left = left;
    s.bottom =
        std::clamp(0.5 * (height_m - s.height) + random.uniform(-0.5, 0.6), 0.15, height_m - s.height - 0.15);
    s.paper = random.uniform(0.6, 0.8);
    s.ink = random.uniform(0.06, 0.2);
    s.seed = random.bits();
    sheets.push_back(s);
    left += s.width + random.uniform(0.15, 0.6);
  }
  return [base = std::move(base), sheets](double u, double v) {
    for (const Sheet& s : sheets) {
      if (const double value = sheet_value(s, u, v); value >= 0) return value;
    }
    return base(u, v);
  };
}

Pattern carton(double mean, double width_m, double height_m, std::uint64_t seed) {
  Random random(seed);
  const double label_u = random.uniform(0.15, 0.45) * width_m,
               label_v = random.uniform(0.15, 0.45) * height_m;
  const double label_width = 0.4 * width_m, label_height = 0.3 * height_m;
  return [=](double u, double v) {
    const double x = (u - label_u) / label_width, y = (v - label_v) / label_height;
    if (within(x, 0, 1) && within(y, 0, 1)) {
      const bool bar = within(x, 0.08, 0.92) && within(y, 0.1, 0.55) &&
                       cell_value(cell(x * label_width, 0.006).index, 0, seed) > 0.5;
      const bool print =
          within(x, 0.08, 0.7) && y > 0.65 &&
          cell_value(cell(x * label_width, 0.012).index, cell(y * label_height, 0.014).index, seed) > 0.55;
      return bar || print ? 0.1 : 0.75;
    }
    if (std::abs(u - 0.5 * width_m) < 0.03) return 1.35 * mean;  // tape
    const Cell i = cell(u, 0.07), j = cell(v, 0.08);
    const bool stencil = v > 0.72 * height_m && v < 0.9 * height_m && i.offset_m < 0.045 &&
                         cell_value(i.index, cell(v, 0.02).index, seed + 1) > 0.4;
    const double flute = 0.05 * std::sin(u * 700) + 0.07 * noise(u / 0.04, v / 0.015, seed + 2);
    return mean * (stencil ? 0.4 : 1 + flute + (j.index == 2 && i.offset_m < 0.01 ? -0.3 : 0.0));
  };
}

}  // namespace evpose::sim
