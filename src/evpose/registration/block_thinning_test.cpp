// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/block_thinning.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>

namespace evpose {
namespace {

constexpr ImageSize kSize{640, 480};
constexpr int kBlock = 32, kColumns = 20, kRows = 15;

Eigen::Vector2d middle_of(int column, int row) { return Eigen::Vector2d(column + 0.5, row + 0.5) * kBlock; }

TEST(BlockThinning, WithoutAShareTakesAll) {
  EXPECT_TRUE(BlockThinning().takes_all());
  EXPECT_TRUE(BlockThinning(kSize, 1, 5).takes_all());
  for (double x : {-1e9, -50.0, 0.0, 639.9, 1e9}) EXPECT_TRUE(BlockThinning(kSize, 1, 5).takes({x, 3}));
}

TEST(BlockThinning, TakesBlocksAsAWhole) {
  const BlockThinning thinning(kSize, 0.4, 7);
  for (int y = 0; y < kSize.height; ++y)
    for (int x = 0; x < kSize.width; ++x)
      ASSERT_EQ(thinning.takes(Eigen::Vector2d(x, y)), thinning.takes(middle_of(x / kBlock, y / kBlock)));
}

/// Each block in its share of the turns, and of each part of the image its share at every turn.
TEST(BlockThinning, IsFairOverTurnsAndOverTheImage) {
  constexpr int kTurns = 400;
  for (const double share : {0.05, 0.3, 0.77}) {
    std::array<int, kColumns * kRows> taken{};
    for (int turn = 0; turn < kTurns; ++turn) {
      const BlockThinning thinning(kSize, share, turn);
      std::array<int, 4> quarter{};
      for (int row = 0; row < kRows; ++row)
        for (int column = 0; column < kColumns; ++column) {
          const bool takes = thinning.takes(middle_of(column, row));
          taken[static_cast<std::size_t>(row * kColumns + column)] += takes;
          quarter[static_cast<std::size_t>(2 * (row >= kRows / 2) + (column >= kColumns / 2))] += takes;
        }
      for (int q = 0; q < 4; ++q) {
        const int blocks = kColumns / 2 * (q < 2 ? kRows / 2 : kRows - kRows / 2);
        ASSERT_NEAR(quarter[static_cast<std::size_t>(q)], share * blocks, 4.5) << share << ' ' << turn;
      }
    }
    for (const int n : taken) ASSERT_NEAR(n, share * kTurns, 3) << share;
  }
}

}  // namespace
}  // namespace evpose
