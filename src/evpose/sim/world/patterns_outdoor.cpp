// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "evpose/sim/world/pattern_noise.h"
#include "evpose/sim/world/patterns.h"

namespace evpose::sim {

Pattern paving(const Repeat& repeat, std::uint64_t seed) {
  const CellRow rows(repeat.height_m, 0.21), stones(repeat.width_m, 0.36);
  const Noise grain(repeat, 0.02, seed + 1), dirt(repeat, 0.5, seed + 2), rough(repeat, 0.06, seed + 3);
  const Spots gum(repeat, 0.09, 0.3, seed + 4), moss(repeat, 0.3, 0.25, seed + 5);
  return [=](double u, double v) {
    const auto row = rows.at(v);
    const auto stone = stones.at(u + stones.size_m * cell_value(row.index, 1, seed));
    const double joint = 0.012 + 0.006 * rough(u, v);
    if (row.offset_m < joint || stone.offset_m < joint) return 0.15 + 0.06 * grain(u, v);
    const double tone = 0.36 + 0.34 * cell_value(stone.index, row.index, seed);
    const double patch = moss(u, v) < -0.3 ? 0.72 : 1.0;
    return tone * patch * (1 + 0.2 * grain(u, v) + 0.18 * rough(u, v) + 0.16 * dirt(u, v) + 0.4 * gum(u, v));
  };
}

Pattern asphalt(const Repeat& repeat, std::uint64_t seed) {
  const Spots stones(repeat, 0.024, 0.8, seed), pebbles(repeat, 0.06, 0.3, seed + 1),
      oil(repeat, 0.7, 0.4, seed + 2);
  const Noise dust(repeat, 0.25, seed + 3), cracks(repeat, 0.6, seed + 4), bend(repeat, 0.08, seed + 5);
  const CellRow us(repeat.width_m, 2.0), vs(repeat.height_m, 1.6);
  return [=](double u, double v) {
    const double patch = 0.85 + 0.35 * (cell_value(us.at(u).index, vs.at(v).index, seed) > 0.7);
    const double crack = std::abs(cracks(u, v) + 0.15 * bend(u, v)) < 0.015 ? 0.35 : 1.0;
    const double spill = oil(u, v) < -0.5 ? 0.65 : 1.0;
    return crack * spill * patch * 0.45 *
           (1 + 0.5 * stones(u, v) + 0.35 * pebbles(u, v) + 0.22 * dust(u, v) + 0.1 * bend(u, v));
  };
}

Pattern gravel(const Repeat& repeat, std::uint64_t seed) {
  const Spots big(repeat, 0.07, 0.5, seed), middle(repeat, 0.04, 0.8, seed + 1),
      small(repeat, 0.022, 0.9, seed + 2);
  const Noise damp(repeat, 0.6, seed + 3), shade(repeat, 0.03, seed + 4);
  return [=](double u, double v) {
    double stone = big(u, v);
    if (stone == 0) stone = 0.9 * middle(u, v);
    if (stone == 0) stone = 0.8 * small(u, v);
    return 0.46 * (1 + 0.75 * stone + 0.2 * damp(u, v) + 0.18 * shade(u, v));
  };
}

Pattern grass(const Repeat& repeat, std::uint64_t seed) {
  const Noise blades(repeat, 0.010, 0.045, seed), tufts(repeat, 0.05, 0.09, seed + 1),
      field(repeat, 0.7, seed + 2);
  const Noise lean(repeat, 0.2, seed + 3);
  const Spots flowers(repeat, 0.11, 0.18, seed + 4), bare(repeat, 0.5, 0.3, seed + 5);
  return [=](double u, double v) {
    if (flowers(u, v) > 0.55) return 0.9;
    const double soil = bare(u, v) > 0.4 ? 1.5 : 1.0;
    return soil * 0.42 *
           (1 + 0.55 * blades(u + 0.03 * lean(u, v), v) + 0.35 * tufts(u, v) + 0.2 * field(u, v));
  };
}

Pattern concrete(const Repeat& repeat, std::uint64_t seed) {
  const CellRow us(repeat.width_m, 1.25), vs(repeat.height_m, 0.8);
  const Noise clouds(repeat, 0.3, seed), grain(repeat, 0.022, seed + 1), streaks(repeat, 0.05, 0.9, seed + 2);
  const Spots pores(repeat, 0.035, 0.5, seed + 3), repairs(repeat, 0.45, 0.35, seed + 4);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v);
    if (i.offset_m < 0.012 || j.offset_m < 0.012) return 0.22;
    const double x = i.offset_m / us.size_m - 0.5, y = j.offset_m / vs.size_m - 0.5;
    if (std::hypot((std::abs(x) - 0.3) * us.size_m, (std::abs(y) - 0.28) * vs.size_m) < 0.022) return 0.14;
    const double tone = 0.46 + 0.16 * cell_value(i.index, j.index, seed);
    return tone * (1 + 0.16 * clouds(u, v) + 0.14 * grain(u, v) - 0.3 * std::max(0.0, streaks(u, v) - 0.3) +
                   0.6 * std::min(0.0, pores(u, v)) + 0.22 * repairs(u, v));
  };
}

Pattern stucco(const Repeat& repeat, std::uint64_t seed) {
  const Noise grain(repeat, 0.028, seed), clouds(repeat, 0.5, seed + 1), runs(repeat, 0.07, 1.1, seed + 2);
  const Noise peel(repeat, 0.45, seed + 3), rim(repeat, 0.05, seed + 4), cracks(repeat, 0.8, seed + 5);
  const Spots blots(repeat, 0.16, 0.35, seed + 6), pits(repeat, 0.045, 0.5, seed + 7);
  return [=](double u, double v) {
    const bool bare = peel(u, v) + 0.2 * rim(u, v) > 0.62;
    const double crack = std::abs(cracks(u, v) + 0.1 * rim(u, v)) < 0.01 ? 0.45 : 1.0;
    return crack * (bare ? 0.3 : 0.56) *
           (1 + 0.22 * grain(u, v) + 0.15 * clouds(u, v) - 0.35 * std::max(0.0, runs(u, v) - 0.25) +
            0.25 * blots(u, v) + 0.5 * std::min(0.0, pits(u, v)));
  };
}

Pattern graffiti(const Repeat& repeat, std::uint64_t seed) {
  const Pattern wall = concrete(repeat, seed + 1);
  const CellRow us(repeat.width_m, 1.6), vs(repeat.height_m, 1.3);
  const Noise swell(repeat, 0.35, seed + 2), sway(repeat, 0.3, seed + 5), shapes(repeat, 0.3, seed + 3),
      mist(repeat, 0.06, seed + 4);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v);
    const double pick = cell_value(i.index, j.index, seed);
    if (pick < 0.72) return wall(u, v);
    const double x = i.offset_m / us.size_m + 0.05 * swell(u, v),
                 y = j.offset_m / vs.size_m + 0.06 * sway(u, v);
    const auto mark = mix(seed + static_cast<std::uint64_t>(i.index * 97 + j.index));
    if (x > 0.08 && x < 0.92 && y > 0.2 && y < 0.75) {  // a swollen word, dark rimmed
      const double place = (x - 0.08) / 0.84 * 4, letter = std::floor(place);
      const std::uint64_t which = mark + static_cast<std::uint64_t>(letter);
      const double rise = (y - 0.2) / 0.55;
      if (letter_ink(place - letter, rise, which)) return 0.62 + 0.3 * cell_value(i.index, 5, seed);
      if (letter_ink(place - letter - 0.1, rise + 0.06, which)) return 0.06;
    }
    const double shape = shapes(u, v) + 0.2 * mist(u, v);
    if (pick > 0.85 && shape > 0.25) return 0.14 + 0.5 * pick * (mist(u, v) > 0);
    return wall(u, v);
  };
}

Pattern window_panes(const Repeat& repeat, double pane_m, std::uint64_t seed) {
  const CellRow us(repeat.width_m, pane_m), vs(repeat.height_m, pane_m);
  const Noise glare(repeat, 0.5, seed), folds(repeat, 0.05, 0.6, seed + 1), leaves(repeat, 0.05, seed + 2);
  const Spots things(repeat, 0.16, 0.5, seed + 3);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v);
    const double x = i.offset_m / us.size_m, y = j.offset_m / vs.size_m;
    const double pick = cell_value(i.index, j.index, seed);
    double tone = 0.1 + 0.05 * glare(u, v) + 0.08 * std::max(0.0, things(u, v));
    if (pick < 0.4 && (x < 0.28 || x > 0.75)) tone = 0.6 + 0.22 * folds(u, v);             // curtains
    if (pick > 0.7 && y > 0.3 + 0.5 * pick) tone = std::fmod(y, 0.08) < 0.05 ? 0.7 : 0.4;  // blind
    if (pick > 0.3 && pick < 0.6 && y < 0.3 && leaves(u, v) > 0.1) tone = 0.3;             // plants
    return tone + 0.04 * leaves(u, v);
  };
}

}  // namespace evpose::sim
