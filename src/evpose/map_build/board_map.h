// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map/contour_map.h"

namespace evpose {

/// Squares, the one at the lower left dark, on a bright sheet that reaches beyond them.
struct Checkerboard {
  int columns = 9, rows = 7;  ///< squares, not the corners between them
  double square_m = 0.08;
};

/// Kalibr's: tags in rows and columns, small dark squares between their corners. Of a tag its outline alone
/// is known, not what is printed inside.
struct AprilGrid {
  int columns = 6, rows = 6;  ///< tags
  double tag_m = 0.088;       ///< side of a tag
  double spacing = 0.3;       ///< distance between tags as a share of that
};

/// Dark discs on bright ground.
struct CircleGrid {
  int columns = 4, rows = 11;  ///< discs of a row, rows
  double distance_m = 0.04;  ///< between rows; of discs in a row, or half of it where every second is shifted
  double diameter_m = 0.02;
  bool shifted = false;  ///< every second row by half a distance (OpenCV's asymmetric grid)
};

using Board = std::variant<Checkerboard, AprilGrid, CircleGrid>;

/// The contours of a printed board with their exact places and contrast. The board stands upright: its middle
/// is the origin, x points to the right as one looks at it, y into it, z up. Errors: counts below two or
/// above a thousand, sizes that are not positive, discs that touch.
Expected<ContourMap> board_map(const Board& board);

/// How the board may be turned without looking any different, in words; empty if it may not.
std::string board_symmetry(const Board& board);

}  // namespace evpose
