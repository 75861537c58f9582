// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/map/board.h"

namespace evpose {

/// Marked points of a board, row by row from the lower left: corners between squares, middles of discs. In
/// the board's frame, metres.
struct BoardLattice {
  int columns = 0, rows = 0;
  std::vector<Eigen::Vector3d> points;
};
/// None of an AprilGrid: its tags are not read.
std::optional<BoardLattice> lattice_of(const Board& board);

/// Pixels of the lattice's points.
using LatticePixels = std::vector<Eigen::Vector2d>;

/// Finds a whole board in pictures, by OpenCV. Of two ways round that look the same, the one that is nearer
/// to `last` (empty: that which has the board upright in the picture).
class BoardFinder {
 public:
  BoardFinder(const Board& board, const BoardLattice& lattice) : board_(board), lattice_(lattice) {}

  /// The picture row by row, dark is low; any scale.
  std::optional<LatticePixels> find(std::span<const float> picture, ImageSize size,
                                    const LatticePixels& last = {}) const;
  /// Whether the program was built with OpenCV.
  static bool available();

 private:
  Board board_;
  BoardLattice lattice_;
};

/// The orders of the points of a grid, given row by row in any order of rows and columns, in which columns
/// run to the right where rows run up, as on a board that is seen from its front: two, or four of a square
/// one.
std::vector<LatticePixels> orders_from_front(const LatticePixels& grid, int columns, int rows);
/// How far the cells between the points of a checkerboard are dark and bright as they should be: above zero
/// in the right order.
double checkers_agree(std::span<const float> picture, ImageSize size, const LatticePixels& corners,
                      int columns, int rows);

}  // namespace evpose
