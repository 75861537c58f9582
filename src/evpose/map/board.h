// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <variant>

namespace evpose {

/// Squares, the one at the lower left dark, on a bright sheet that reaches beyond them.
struct Checkerboard {
  int columns = 9, rows = 7;  ///< squares, not the corners between them
  double square_m = 0.08;
  bool operator==(const Checkerboard&) const = default;
};

/// Kalibr's: tags in rows and columns, small dark squares between their corners. Of a tag its outline alone
/// is among the contours, not what is printed inside.
struct AprilGrid {
  int columns = 6, rows = 6;  ///< tags
  double tag_m = 0.088;       ///< side of a tag
  double spacing = 0.3;       ///< distance between tags as a share of that
  bool operator==(const AprilGrid&) const = default;
};

/// Dark discs on bright ground.
struct CircleGrid {
  int columns = 4, rows = 11;  ///< discs of a row, rows
  double distance_m = 0.04;  ///< between rows; of discs in a row, or half of it where every second is shifted
  double diameter_m = 0.02;
  bool shifted = false;  ///< every second row by half a distance (OpenCV's asymmetric grid)
  bool operator==(const CircleGrid&) const = default;
};

/// A printed board. It stands upright: its middle is the origin, x points to the right as one looks at it, y
/// into it, z up.
using Board = std::variant<Checkerboard, AprilGrid, CircleGrid>;

/// As a map file has it: "checkerboard 9 7 0.08", "aprilgrid 6 6 0.088 0.3", "circles 4 11 0.04 0.02
/// shifted".
std::string board_words(const Board& board);
/// None where the words are no board.
std::optional<Board> read_board_words(const std::string& words);

}  // namespace evpose
