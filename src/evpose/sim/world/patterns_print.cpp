// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "evpose/sim/world/pattern_noise.h"
#include "evpose/sim/world/patterns.h"

namespace evpose::sim {

Pattern poster(const Repeat& repeat, std::uint64_t seed) {
  const double width = repeat.width_m, height = repeat.height_m;
  Random random(seed);
  const double paper = random.uniform(0.6, 0.85), ink = random.uniform(0.04, 0.16);
  const double margin = 0.05 * std::min(width, height), letter = width / std::floor(random.uniform(7, 12));
  const double headline = height - margin - 1.5 * letter;
  const double picture = random.uniform(0.3, 0.62) * headline, line = random.uniform(0.016, 0.024);
  const Noise shapes(repeat, width / 5, seed + 1), detail(repeat, width / 17, seed + 2),
      raster(repeat, 0.012, seed + 3);
  const double column = width / 2;
  return [=](double u, double v) {
    if (u < margin || u > width - margin || v < margin || v > height - margin) return paper;
    if (v > headline) return words_ink(u, (v - headline) / (1.4 * letter), letter, seed) ? ink : paper;
    if (v > picture) {
      const double shape = shapes(u, v) + 0.5 * detail(u, v);
      const double tone = shape > 0.35 ? 0.55 : shape > -0.05 ? 0.16 : 0.32;
      return v < picture + 0.02 ? paper : tone * (1 + 0.3 * raster(u, v) + 0.3 * detail(v, u));
    }
    const double row = std::floor(v / line), rise = v / line - row;
    const double x = std::fmod(u, column);
    if (x > column - margin || rise > 0.62) return paper;
    return words_ink(x, rise / 0.62, 0.5 * line,
                     mix(seed + static_cast<std::uint64_t>(row * 2 + (u > column))))
               ? ink
               : paper;
  };
}

Pattern carton(const Repeat& repeat, std::uint64_t seed) {
  const CellRow us(repeat.width_m, 0.5), vs(repeat.height_m, 0.4);
  const Noise flutes(repeat, 0.012, 0.2, seed + 1), clouds(repeat, 0.1, seed + 2),
      fibre(repeat, 0.02, 0.006, seed + 3);
  const Spots dents(repeat, 0.06, 0.25, seed + 4);
  return [=](double u, double v) {
    const auto i = us.at(u), j = vs.at(v);
    const double x = i.offset_m, y = j.offset_m;
    const auto at = mix(seed + static_cast<std::uint64_t>(i.index * 131 + j.index));
    const double pick = cell_value(i.index, j.index, seed + 5);
    const double board =
        0.44 * (1 + 0.16 * flutes(u, v) + 0.12 * clouds(u, v) + 0.12 * fibre(u, v) + 0.35 * dents(u, v));
    if (std::abs(x - 0.06) < 0.022) return 0.72 + 0.08 * clouds(u, v);  // tape
    const double left = 0.12 + 0.1 * pick, low = 0.05 + 0.06 * pick;
    if (x > left && x < left + 0.16 && y > low && y < low + 0.11) {  // label
      const double a = x - left, b = y - low;
      if (b < 0.045 && b > 0.008 && a > 0.01 && a < 0.11)
        return cell_value(static_cast<std::int64_t>(a / 0.004), 1, at) > 0.5 ? 0.07 : 0.85;
      if (b > 0.055 && b < 0.1 && a > 0.01 && words_ink(a, std::fmod(b - 0.055, 0.016) / 0.012, 0.01, at))
        return 0.1;
      return 0.85;
    }
    if (y > 0.24 && y < 0.33 && x > 0.12 && pick > 0.3 && words_ink(x, (y - 0.24) / 0.09, 0.06, at + 7))
      return 0.1;
    return board;
  };
}

Pattern book_spines(const Repeat& repeat, double row_m, std::uint64_t seed) {
  // Widths of books differ: cells of 8 mm are dealt out in groups.
  const CellRow steps(repeat.width_m, 0.008), rows(repeat.height_m, row_m);
  struct Book {
    float left, width;
    std::uint64_t look;
  };
  std::vector<std::vector<Book>> by_step;
  for (int row = 0; row < rows.count; ++row) {
    Random random(seed, static_cast<std::uint64_t>(row));
    auto& books = by_step.emplace_back();
    for (int step = 0; step < steps.count;) {
      const int span = std::min(steps.count - step, 2 + static_cast<int>(random.uniform() * 5));
      const Book book{static_cast<float>(step * steps.size_m), static_cast<float>(span * steps.size_m),
                      random.bits()};
      for (int i = 0; i < span; ++i) books.push_back(book);
      step += span;
    }
  }
  const Noise wear(repeat, 0.03, seed + 1);
  return [=](double u, double v) {
    const auto step = steps.at(u), row = rows.at(v);
    const Book& book = by_step[static_cast<std::size_t>(row.index)][static_cast<std::size_t>(step.index)];
    const double x = step.index * steps.size_m + step.offset_m - book.left, y = row.offset_m / rows.size_m;
    if (x < 0.003) return 0.04;  // the gap between two
    const auto value = [&](int i) { return cell_value(i, 0, book.look); };
    const double tone =
        (value(0) < 0.4 ? 0.08 + 0.15 * value(1) : 0.25 + 0.55 * value(1)) * (1 + 0.15 * wear(u, v));
    const double print = tone < 0.35 ? 0.75 : 0.08;
    if (std::abs(y - 0.12 - 0.1 * value(2)) < 0.02 || std::abs(y - 0.85 - 0.08 * value(3)) < 0.014)
      return print;
    if (value(4) > 0.6 && std::abs(y - 0.3) < 0.05) return 0.5 * (tone + print);
    const double across = (x - 0.3 * book.width) / (0.45 * book.width);
    if (y > 0.36 && y < 0.36 + 0.2 + 0.2 * value(5) && words_ink(row.offset_m, across, 0.014, book.look))
      return print;
    return tone;
  };
}

Pattern screen_text(const Repeat& repeat, std::uint64_t seed) {
  const CellRow lines(repeat.height_m, 0.02);
  return [=](double u, double v) {
    const auto line = lines.at(v);
    const double indent = 0.02 + 0.03 * std::floor(4 * cell_value(line.index, 1, seed));
    const double end = indent + (repeat.width_m - 0.1) * (0.5 + 0.5 * cell_value(line.index, 2, seed));
    if (u < indent || u > end || line.offset_m > 0.013) return 0.08;
    const double bright = 0.5 + 0.4 * cell_value(line.index, static_cast<std::int64_t>(u / 0.06), seed + 1);
    return words_ink(u, line.offset_m / 0.013, 0.009, mix(seed + static_cast<std::uint64_t>(line.index)))
               ? bright
               : 0.08;
  };
}

Pattern container_side(const Repeat& repeat, std::uint64_t seed) {
  const CellRow ribs(repeat.width_m, 0.14), us(repeat.width_m, 2), vs(repeat.height_m, 1.2);
  const Noise rust(repeat, 0.25, 0.5, seed + 1), rim(repeat, 0.05, seed + 2),
      scratch(repeat, 0.2, 0.01, seed + 3);
  const Spots chips(repeat, 0.06, 0.4, seed + 4);
  return [=](double u, double v) {
    const auto rib = ribs.at(u), i = us.at(u), j = vs.at(v);
    const double x = i.offset_m / us.size_m, y = j.offset_m / vs.size_m;
    const auto word = mix(seed + static_cast<std::uint64_t>(i.index * 31 + j.index));
    const double shade = rib.offset_m < 0.03   ? 0.7
                         : rib.offset_m < 0.07 ? 1.0
                         : rib.offset_m < 0.1  ? 1.25
                                               : 0.9;
    double tone = 0.42;
    if (y > 0.45 && y < 0.8 && x > 0.1 && x < 0.9 && words_ink(i.offset_m, (y - 0.45) / 0.35, 0.27, word))
      tone = 0.85;
    if (y > 0.2 && y < 0.32 && x > 0.1 && words_ink(i.offset_m, (y - 0.2) / 0.12, 0.09, word + 1)) tone = 0.8;
    if (rust(u, v) + 0.3 * rim(u, v) > 0.6) tone *= 0.4;
    return tone * shade * (1 + 0.15 * scratch(u, v) + 0.35 * chips(u, v) + 0.1 * rim(u, v));
  };
}

}  // namespace evpose::sim
