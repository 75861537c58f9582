// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "evpose/sim/world/mesh_builder.h"

namespace evpose::sim {

enum class PadMark : std::uint8_t { none, h, ring, squares };
/// By their names.
std::vector<std::pair<std::string, PadMark>> pad_marks();

/// A square landing pad that stands on its middle: sides of `size`, a top at `height`, marked by exact edges.
struct LandingPad {
  double size = 1.5, height = 0.3;  // metres; height 0: a sheet on the ground
  PadMark mark = PadMark::h;
};
/// Proportions of the mark, as fractions of the size: an H of 0.4 x 0.6 with strokes of 0.1; a ring of radius
/// 0.32 to 0.4; rings of squares 0.1 wide.
void add_landing_pad(Mesh& mesh, const Pose& T_mesh_pad, const LandingPad& pad, const Finish& ground,
                     const Finish& mark);

/// A checkerboard, upright on a stand, that faces -y.
struct Checkerboard {
  int columns = 9, rows = 6;  ///< squares
  double square_m = 0.06;
  double margin_m = 0.06;  ///< of bare board around the squares
  double middle_m = 1.2;   ///< height of the middle of the squares above the foot
};
/// The frame of the board: origin on the floor below the middle of the squares, which lie in y = 0 from
/// x = -columns / 2 squares, z = middle_m - rows / 2 squares; the square at that corner is a dark one.
void add_checkerboard(Mesh& mesh, const Pose& T_mesh_board, const Checkerboard& board, const Finish& bright,
                      const Finish& dark);

}  // namespace evpose::sim
