// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/patterns.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/sim/world/pattern_noise.h"

namespace evpose::sim {

Pattern bricks(const Repeat& repeat, std::uint64_t seed) {
  const CellRow rows(repeat.height_m, 0.078), columns(repeat.width_m, 0.25);
  const Noise pits(repeat, 0.012, seed + 1), clouds(repeat, 0.06, 0.03, seed + 2),
      soot(repeat, 0.7, seed + 3);
  const Spots chips(repeat, 0.05, 0.35, seed + 4);
  return [=](double u, double v) {
    const auto row = rows.at(v);
    const auto brick =
        columns.at(u + columns.size_m * ((row.index & 1) * 0.5 + 0.1 * cell_value(row.index, 0, seed)));
    const double wear = 1 + 0.2 * soot(u, v);
    const double joint = 0.011 + 0.004 * clouds(u, v);
    if (row.offset_m < joint || brick.offset_m < joint) return wear * (0.78 + 0.12 * pits(u, v));
    const double tone = 0.26 + 0.36 * cell_value(brick.index, row.index, seed);
    return wear * tone * (1 + 0.3 * pits(u, v) + 0.25 * clouds(u, v) + 0.5 * chips(u, v));
  };
}

Pattern tiles(const Repeat& repeat, double tile_m, std::uint64_t seed) {
  const CellRow us(repeat.width_m, tile_m), vs(repeat.height_m, tile_m);
  const Noise veins(repeat, 0.11, seed + 2), grain(repeat, 0.016, seed + 3);
  const Spots stains(repeat, 0.04, 0.3, seed + 4);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v);
    if (i.offset_m < 0.008 || j.offset_m < 0.008) return 0.16 + 0.05 * grain(u, v);
    const double x = i.offset_m / us.size_m - 0.5, y = j.offset_m / vs.size_m - 0.5;
    const double pick = cell_value(i.index, j.index, seed + 1),
                 tone = 0.4 + 0.35 * cell_value(i.index, j.index, seed);
    double inlay = 1;
    if (pick < 0.25 && std::abs(x) + std::abs(y) < 0.24) inlay = 0.4;
    if (pick > 0.8 && x * x + y * y < 0.06 && x * x + y * y > 0.03) inlay = 0.5;
    const double vein = std::abs(veins(u, v)) < 0.05 ? 0.6 : 1.0;
    return tone * inlay * vein * (1 + 0.18 * grain(u, v) + 0.35 * stains(u, v));
  };
}

Pattern planks(const Repeat& repeat, double plank_m, std::uint64_t seed) {
  const CellRow rows(repeat.height_m, plank_m), boards(repeat.width_m, 1.1);
  const Noise grain(repeat, 0.28, 0.008, seed + 1), fibre(repeat, 0.09, 0.004, seed + 2);
  const Noise bend(repeat, 0.4, 0.1, seed + 3), knots(repeat, 0.16, 0.06, seed + 4);
  const Spots scuffs(repeat, 0.07, 0.15, seed + 5);
  return [=](double u, double v) {
    const auto row = rows.at(v);
    const auto board = boards.at(u + boards.size_m * 3 * cell_value(row.index, 1, seed));
    if (row.offset_m < 0.006 || board.offset_m < 0.006) return 0.12;
    const double tone = 0.34 + 0.34 * cell_value(board.index, row.index, seed);
    const double shift = 0.02 * bend(u, v) + 0.37 * cell_value(board.index, row.index, seed + 6);
    const double knot = knots(u, v);
    return tone * (1 + 0.42 * grain(u, v + shift) + 0.16 * fibre(u, v) + 0.3 * scuffs(u, v) -
                   (knot > 0.7   ? 0.55
                    : knot > 0.6 ? 0.2
                                 : 0.0));
  };
}

Pattern plaster(const Repeat& repeat, std::uint64_t seed) {
  const Noise stains(repeat, 0.4, seed), blots(repeat, 0.12, seed + 1), grain(repeat, 0.02, seed + 2);
  const Noise cracks(repeat, 0.5, seed + 3), warp(repeat, 0.07, seed + 4);
  const Spots marks(repeat, 0.06, 0.22, seed + 5), dots(repeat, 0.022, 0.3, seed + 6);
  return [=](double u, double v) {
    const double crack = std::abs(cracks(u, v) + 0.12 * warp(u, v)) < 0.012 ? 0.4 : 1.0;
    const double mark = marks(u, v), dot = dots(u, v);
    return crack * 0.55 *
           (1 + 0.16 * stains(u, v) + 0.14 * blots(u, v) + 0.12 * grain(u, v) + 0.45 * std::min(0.0, mark) +
            0.2 * std::max(0.0, mark) + 0.5 * std::min(0.0, dot));
  };
}

Pattern wallpaper(const Repeat& repeat, std::uint64_t seed) {
  const CellRow us(repeat.width_m, 0.115), vs(repeat.height_m, 0.13);
  const Noise fade(repeat, 0.6, seed + 1), grain(repeat, 0.014, seed + 2);
  const Spots dots(repeat, 0.034, 0.4, seed + 3);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v + 0.065 * (us.at(u).index & 1));
    const double x = i.offset_m / us.size_m - 0.5, y = j.offset_m / vs.size_m - 0.5;
    const double radius = std::hypot(x, y), angle = std::atan2(y, x);
    const double pick = cell_value(i.index, j.index, seed),
                 turn = 6.3 * cell_value(i.index, j.index, seed + 4);
    bool ink = false;
    if (pick < 0.45)
      ink = radius < 0.22 + 0.11 * std::cos(5 * angle + turn);
    else if (pick < 0.65)
      ink = radius > 0.16 && radius < 0.27;
    else if (pick < 0.85)
      ink = std::abs(std::sin(angle + turn)) * radius < 0.05 && radius < 0.4;
    const double stripe = 0.5 + 0.16 * cell_value(i.index, 0, seed + 5);
    const double motif = 0.3 + 0.25 * cell_value(i.index, j.index, seed + 6);
    return (ink ? stripe * motif * 1.4 : stripe) *
           (1 + 0.12 * fade(u, v) + 0.1 * grain(u, v) + 0.3 * dots(u, v)) * (i.offset_m < 0.008 ? 0.7 : 1.0);
  };
}

Pattern ceiling_panels(const Repeat& repeat, std::uint64_t seed) {
  const CellRow us(repeat.width_m, 0.6), vs(repeat.height_m, 0.6);
  const Spots holes(repeat, 0.03, 0.75, seed), worms(repeat, 0.07, 0.4, seed + 1);
  const Noise water(repeat, 0.5, seed + 2), curl(repeat, 0.03, 0.015, seed + 3);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v);
    if (i.offset_m < 0.018 || j.offset_m < 0.018)
      return i.offset_m < 0.009 || j.offset_m < 0.009 ? 0.3 : 0.85;
    const double tone = 0.6 + 0.12 * cell_value(i.index, j.index, seed);
    const double stain = water(u, v) > 0.55 ? 0.75 : 1.0;
    return tone * stain *
           (1 + 0.6 * std::min(0.0, holes(u, v)) + 0.3 * worms(u, v) + (curl(u, v) > 0.62 ? -0.35 : 0.0));
  };
}

Pattern marble(const Repeat& repeat, std::uint64_t seed) {
  const Noise broad(repeat, 0.35, 0.5, seed), fine(repeat, 0.09, 0.13, seed + 1),
      clouds(repeat, 0.25, seed + 2);
  const Noise grain(repeat, 0.015, seed + 3);
  const Spots shells(repeat, 0.05, 0.2, seed + 4);
  return [=](double u, double v) {
    const double bend = 0.35 * fine(u, v);
    const double vein = std::abs(broad(u, v) + bend), thread = std::abs(fine(u + 0.5, v) + 0.3 * grain(u, v));
    double tone = 0.6 + 0.13 * clouds(u, v) + 0.06 * grain(u, v) + 0.2 * shells(u, v);
    if (vein < 0.05) tone *= 0.3;
    if (thread < 0.05) tone *= 0.65;
    return tone;
  };
}

Pattern carpet(const Repeat& repeat, std::uint64_t seed) {
  const CellRow us(repeat.width_m, 0.16), vs(repeat.height_m, 0.09);
  const Noise pile(repeat, 0.008, seed), wear(repeat, 0.5, seed + 1), drift(repeat, 0.3, seed + 2);
  const Spots knots(repeat, 0.03, 0.4, seed + 3);
  return [=](double u, double v) {
    const auto i = us.at(u);
    const double zigzag = std::abs(i.offset_m / us.size_m - 0.5) * 0.12 + 0.02 * drift(u, v);
    const auto j = vs.at(v + zigzag);
    const double band = cell_value(0, j.index, seed + 4), yarn = cell_value(i.index, j.index, seed + 5);
    const bool stripe = j.offset_m < 0.5 * vs.size_m;
    const double tone = stripe ? 0.16 + 0.2 * band : 0.5 + 0.35 * band;
    return tone * (0.85 + 0.3 * yarn) * (1 + 0.25 * pile(u, v) + 0.15 * wear(u, v) + 0.4 * knots(u, v));
  };
}

Pattern cloth(const Repeat& repeat, std::uint64_t seed) {
  const CellRow us(repeat.width_m, 0.085), vs(repeat.height_m, 0.085);
  const Noise weave(repeat, 0.008, seed), folds(repeat, 0.09, 0.3, seed + 1);
  const Spots flecks(repeat, 0.03, 0.35, seed + 2);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v);
    const bool along = i.offset_m < 0.012 + 0.02 * cell_value(i.index, 0, seed + 3);
    const bool across = j.offset_m < 0.012 + 0.02 * cell_value(0, j.index, seed + 4);
    const double tone = 0.42 + 0.25 * cell_value(i.index, j.index, seed + 5);
    return tone * (along ? 0.5 : 1.0) * (across ? 0.6 : 1.0) *
           (1 + 0.2 * weave(u, v) + 0.25 * folds(u, v) + 0.4 * flecks(u, v));
  };
}

Pattern with_contrast(Pattern pattern, double factor) {
  return [pattern = std::move(pattern), factor](double u, double v) {
    const double value = std::clamp(pattern(u, v), 0.02, 0.95);
    // The common case costs no power.
    return factor == 1 ? value : std::clamp(0.5 * std::pow(value / 0.5, factor), 0.02, 0.95);
  };
}

}  // namespace evpose::sim
