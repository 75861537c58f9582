// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/patterns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace evpose::sim {
namespace {

const Repeat kRepeat{3, 2.4};

struct Named {
  std::string name;
  Pattern make(std::uint64_t seed) const { return named_pattern(name, kRepeat, seed); }
};

std::vector<Named> all_patterns() {
  std::vector<Named> all;
  for (const std::string& name : pattern_names()) all.push_back({name});
  return all;
}

double fraction_of_differences(const Pattern& a, const Pattern& b, double shift_u, double shift_v) {
  int different = 0;
  for (int i = 0; i < 4000; ++i) {
    const double u = std::fmod(i * 0.61803, 1) * kRepeat.width_m,
                 v = std::fmod(i * 0.75488, 1) * kRepeat.height_m;
    if (std::abs(a(u, v) - b(u + shift_u, v + shift_v)) > 1e-3) ++different;
  }
  return different / 4000.0;
}

TEST(Patterns, AreTheSameForASeedAndDifferBetweenSeeds) {
  for (const Named& p : all_patterns()) {
    EXPECT_EQ(fraction_of_differences(p.make(5), p.make(5), 0, 0), 0) << p.name;
    EXPECT_GT(fraction_of_differences(p.make(5), p.make(6), 0, 0), 0.15) << p.name;
  }
}

// What is to cover large faces has no seam where it repeats, and does not repeat within.
TEST(Patterns, RepeatOverTheirRectangleAndNotWithin) {
  for (const Named& p : all_patterns()) {
    const Pattern pattern = p.make(5);
    const bool single = p.name == "poster" || p.name == "screen_text";
    if (!single) {
      EXPECT_LT(fraction_of_differences(pattern, pattern, kRepeat.width_m, 0), 0.01) << p.name;
      EXPECT_LT(fraction_of_differences(pattern, pattern, 0, kRepeat.height_m), 0.01) << p.name;
      EXPECT_GT(fraction_of_differences(pattern, pattern, kRepeat.width_m / 3, 0), 0.15) << p.name;
    }
  }
}

// Contrast that event pixels notice, in the mean over pixels of the usual size: 10 mm at a few metres
// indoors.
TEST(Patterns, HaveContrastAtAllSizes) {
  for (const Named& p : all_patterns()) {
    const Pattern pattern = p.make(9);
    for (const double size_m : {0.01, 0.04}) {
      double sum_log = 0, mean = 0;
      const auto block = [&](double u, double v) {
        double sum = 0;
        for (int i = 0; i < 16; ++i)
          sum += std::max(0.02, pattern(u + size_m * (i % 4) / 4, v + size_m * 0.25 * std::floor(0.25 * i)));
        return sum / 16;
      };
      for (int i = 0; i < 600; ++i) {
        const double u = 0.1 + std::fmod(i * 0.61803, 1) * (kRepeat.width_m - 0.3),
                     v = 0.1 + std::fmod(i * 0.75488, 1) * (kRepeat.height_m - 0.3);
        const double here = block(u, v);
        sum_log +=
            std::abs(std::log(here / block(u + size_m, v))) + std::abs(std::log(here / block(u, v + size_m)));
        mean += here / 600;
      }
      EXPECT_GT(sum_log / 1200, 0.06) << p.name << " at " << size_m;
      EXPECT_GT(mean, p.name == "screen_text" || p.name == "window_panes" ? 0.1 : 0.3) << p.name;
      EXPECT_LT(mean, 0.75) << p.name;
    }
  }
}

TEST(Patterns, ContrastScalesTheLogarithm) {
  const Pattern flat = [](double u, double) { return u; };
  EXPECT_NEAR(with_contrast(flat, 1)(0.3, 0), 0.3, 1e-12);
  EXPECT_NEAR(with_contrast(flat, 0)(0.3, 0), 0.5, 1e-12);
  EXPECT_NEAR(std::log(with_contrast(flat, 2)(0.4, 0) / 0.5), 2 * std::log(0.4 / 0.5), 1e-12);
}

}  // namespace
}  // namespace evpose::sim
