// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/printed_things.h"

#include <algorithm>
#include <functional>

namespace evpose::sim {
namespace {

using V = Eigen::Vector3d;

// A rectangle in one plane, cut into cells of one of two materials; the edges between them are exact.
struct Stencil {
  V corner, along_u, along_v;  // unit directions
  std::vector<double> us, vs;  // cuts, metres
  std::function<bool(int column, int row)> inked;
};

void add_stencil(Mesh& mesh, const Pose& T, const Stencil& s, const Finish& ground, const Finish& ink) {
  for (std::size_t i = 0; i + 1 < s.us.size(); ++i) {
    for (std::size_t j = 0; j + 1 < s.vs.size(); ++j) {
      Finish finish = s.inked(static_cast<int>(i), static_cast<int>(j)) ? ink : ground;
      finish.along_grain = false;
      finish.uv += Eigen::Vector2d(s.us[i], s.vs[j]);
      const V at = s.corner + s.us[i] * s.along_u + s.vs[j] * s.along_v;
      add_face(
          mesh,
          {T * at, T.q * ((s.us[i + 1] - s.us[i]) * s.along_u), T.q * ((s.vs[j + 1] - s.vs[j]) * s.along_v)},
          finish);
    }
  }
}

Stencil pad_stencil(const LandingPad& pad) {
  Stencil s;
  s.corner = V(-0.5 * pad.size, -0.5 * pad.size, pad.height > 0 ? pad.height : kPrintLift);
  s.along_u = V::UnitX();
  s.along_v = V::UnitY();
  s.inked = [](int, int) { return false; };
  s.us = s.vs = {0, 1};
  if (pad.mark == PadMark::h) {
    s.us = {0, 0.3, 0.4, 0.6, 0.7, 1};
    s.vs = {0, 0.2, 0.45, 0.55, 0.8, 1};
    s.inked = [](int i, int j) { return j > 0 && j < 4 && (i == 1 || i == 3 || (i == 2 && j == 2)); };
  } else if (pad.mark == PadMark::squares) {
    s.us = s.vs = {0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9, 1};
    s.inked = [](int i, int j) { return std::min({i, 8 - i, j, 8 - j}) % 2 == 1; };
  }
  for (double& u : s.us) u *= pad.size;
  for (double& v : s.vs) v *= pad.size;
  return s;
}

}  // namespace

std::vector<std::pair<std::string, PadMark>> pad_marks() {
  return {{"none", PadMark::none}, {"h", PadMark::h}, {"ring", PadMark::ring}, {"squares", PadMark::squares}};
}

void add_landing_pad(Mesh& mesh, const Pose& T_mesh_pad, const LandingPad& pad, const Finish& ground,
                     const Finish& mark) {
  const Stencil top = pad_stencil(pad);
  add_stencil(mesh, T_mesh_pad, top, ground, mark);
  if (pad.mark == PadMark::ring)
    add_ring(mesh, T_mesh_pad * Pose{Eigen::Quaterniond::Identity(), {0, 0, top.corner.z() + kPrintLift}},
             {0.32 * pad.size, 0.4 * pad.size, 96}, mark);
  if (pad.height > 0)
    add_box(mesh, T_mesh_pad * Pose{Eigen::Quaterniond::Identity(), {0, 0, 0.5 * pad.height}},
            {pad.size, pad.size, pad.height}, ground, side_west | side_east | side_south | side_north);
}

void add_checkerboard(Mesh& mesh, const Pose& T_mesh_board, const Checkerboard& board, const Finish& bright,
                      const Finish& dark) {
  constexpr double kThick_m = 0.02, kLeg_m = 0.04;
  const double width = board.columns * board.square_m, height = board.rows * board.square_m;
  Stencil front;
  front.corner = V(-0.5 * width - board.margin_m, 0, board.middle_m - 0.5 * height - board.margin_m);
  front.along_u = V::UnitX();
  front.along_v = V::UnitZ();
  const auto cuts = [&](int squares, std::vector<double>& out) {
    if (board.margin_m > 0) out.push_back(0);
    for (int i = 0; i <= squares; ++i) out.push_back(board.margin_m + i * board.square_m);
    if (board.margin_m > 0) out.push_back(2 * board.margin_m + squares * board.square_m);
  };
  cuts(board.columns, front.us);
  cuts(board.rows, front.vs);
  const int rim = board.margin_m > 0 ? 1 : 0;
  front.inked = [&board, rim](int i, int j) {
    const int column = i - rim, row = j - rim;
    return column >= 0 && column < board.columns && row >= 0 && row < board.rows && (column + row) % 2 == 0;
  };
  add_stencil(mesh, T_mesh_board, front, bright, dark);
  const V size(width + 2 * board.margin_m, kThick_m, height + 2 * board.margin_m);
  add_box(mesh, T_mesh_board * Pose{Eigen::Quaterniond::Identity(), {0, 0.5 * kThick_m, board.middle_m}},
          size, bright, all_sides & ~static_cast<unsigned>(side_south));
  // Legs behind the board, up to its middle.
  for (const double x : {-0.35 * size.x(), 0.35 * size.x()})
    add_box(mesh,
            T_mesh_board *
                Pose{Eigen::Quaterniond::Identity(), {x, kThick_m + 0.5 * kLeg_m, 0.5 * board.middle_m}},
            {kLeg_m, kLeg_m, board.middle_m}, dark,
            all_sides & ~static_cast<unsigned>(side_below | side_south));
}

}  // namespace evpose::sim
