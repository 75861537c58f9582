// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/keep_different.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace evpose {
namespace {

struct Guess {
  double at, score;
  bool operator==(const Guess&) const = default;
};

bool same(const Guess& a, const Guess& b) { return std::abs(a.at - b.at) < 1; }

TEST(KeepDifferent, OfEachGroupTheBestStaysAndEqualsKeepTheirOrder) {
  std::vector<Guess> guesses = {{0, 1}, {5, 3}, {0.5, 2}, {5.5, 3}, {9, 3}};
  keep_different(guesses, 10, same);
  EXPECT_EQ(guesses, (std::vector<Guess>{{5, 3}, {9, 3}, {0.5, 2}}));
}

TEST(KeepDifferent, WhatIsLeftOutIsTheSameAsABetterOneOrWorseThanAllThatFit) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> at(0, 20), score(0, 1);
  for (const std::size_t most : {0U, 1U, 5U, 100U}) {
    std::vector<Guess> all(60);
    for (Guess& g : all) g = {at(random), score(random)};
    std::vector<Guess> kept = all;
    keep_different(kept, most, same);
    EXPECT_LE(kept.size(), most);
    for (std::size_t i = 0; i < kept.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) {
        EXPECT_FALSE(same(kept[i], kept[j]));
        EXPECT_GE(kept[j].score, kept[i].score);
      }
    for (const Guess& g : all) {
      const bool stays = std::find(kept.begin(), kept.end(), g) != kept.end();
      const bool has_better = std::any_of(kept.begin(), kept.end(),
                                          [&](const Guess& k) { return k.score > g.score && same(k, g); });
      const bool no_room = kept.size() == most && (most == 0 || kept.back().score >= g.score);
      EXPECT_TRUE(stays || has_better || no_room);
    }
  }
}

}  // namespace
}  // namespace evpose
