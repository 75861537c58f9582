// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/board.h"

#include <gtest/gtest.h>

namespace evpose {
namespace {

TEST(Board, IsReadFromItsWords) {
  const Board boards[] = {Checkerboard{9, 7, 0.08}, AprilGrid{6, 5, 0.0881, 0.3},
                          CircleGrid{4, 11, 0.04, 0.02, true}, CircleGrid{7, 6, 1.0 / 3, 0.02, false}};
  for (const Board& board : boards) {
    const auto read = read_board_words(board_words(board));
    ASSERT_TRUE(read.has_value()) << board_words(board);
    EXPECT_EQ(*read, board) << board_words(board);
  }
}

TEST(Board, WordsOfNoBoardAreNone) {
  for (const char* words :
       {"", "checkerboard", "checkerboard 9 7", "checkerboard 9 7 a", "checkerboard 1 7 0.08",
        "checkerboard 9 7 0.08 0.1", "checkerboard 9 7 inf", "circles 4 11 0.04 0.02 turned",
        "aprilgrid 6 6 0.088", "poster 9 7 0.08", "checkerboard 9e9 7 0.08"})
    EXPECT_FALSE(read_board_words(words).has_value()) << words;
}

}  // namespace
}  // namespace evpose
