// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/map/board.h"

namespace evpose {

/// Marked points of a board, row by row from the lower left: corners between squares, middles of discs; of
/// each tag its corners, against the clock from the lower left. In the board's frame, metres.
struct BoardLattice {
  int columns = 0, rows = 0;  ///< points of a row, rows; of tags: tags
  std::vector<Eigen::Vector3d> points;
};
BoardLattice lattice_of(const Board& board);

/// Pixels of the lattice's points; not finite where a point was not seen.
using LatticePixels = std::vector<Eigen::Vector2d>;

/// Finds a board in pictures.
class BoardFinder {
 public:
  virtual ~BoardFinder() = default;
  /// The picture row by row, dark is low; any scale. Of ways round that look the same, the one that is
  /// nearest to `last`; if that is empty, the one that has the board upright in the picture.
  virtual std::optional<LatticePixels> find(std::span<const float> picture, ImageSize size,
                                            const LatticePixels& last) const = 0;
};

/// Whole checkerboards and grids of discs, by OpenCV; null if the program was built without.
std::unique_ptr<BoardFinder> make_grid_finder(const Board& board);
/// Some tags at least of an AprilGrid (family 36h11, number 0 at the lower left, row by row), by AprilTag's
/// library; null if the program was built without.
std::unique_ptr<BoardFinder> make_tag_finder(const AprilGrid& board);
/// The one of them that the board wants. Error: it is null.
Expected<std::unique_ptr<BoardFinder>> make_board_finder(const Board& board);

/// Scale of a picture: its grey values range from minus to plus this, but for a few.
float full_value(std::span<const float> picture);

/// The orders of the points of a grid, given row by row in any order of rows and columns, in which columns
/// run to the right where rows run up, as on a board that is seen from its front: two, or four of a square
/// one.
std::vector<LatticePixels> orders_from_front(const LatticePixels& grid, int columns, int rows);
/// How far the cells between the points of a checkerboard are dark and bright as they should be: above zero
/// in the right order.
double checkers_agree(std::span<const float> picture, ImageSize size, const LatticePixels& corners,
                      int columns, int rows);

}  // namespace evpose
