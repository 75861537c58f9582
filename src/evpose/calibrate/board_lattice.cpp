// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/calibrate/board_finder.h"

namespace evpose {
namespace {

BoardLattice lattice(const Checkerboard& b) {
  BoardLattice out{b.columns - 1, b.rows - 1, {}};
  for (int row = 1; row < b.rows; ++row)
    for (int column = 1; column < b.columns; ++column)
      out.points.emplace_back(b.square_m * (column - 0.5 * b.columns), 0, b.square_m * (row - 0.5 * b.rows));
  return out;
}

BoardLattice lattice(const AprilGrid& b) {
  BoardLattice out{b.columns, b.rows, {}};
  const double step = (1 + b.spacing) * b.tag_m;
  for (int row = 0; row < b.rows; ++row)
    for (int column = 0; column < b.columns; ++column) {
      const Eigen::Vector3d middle(step * (column - 0.5 * (b.columns - 1)), 0,
                                   step * (row - 0.5 * (b.rows - 1)));
      for (const auto& [x, z] : {std::pair(-0.5, -0.5), {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
        out.points.push_back(middle + b.tag_m * Eigen::Vector3d(x, 0, z));
    }
  return out;
}

BoardLattice lattice(const CircleGrid& b) {
  BoardLattice out{b.columns, b.rows, {}};
  const double step = b.shifted ? 2 * b.distance_m : b.distance_m;
  const double width = step * (b.columns - 1) + (b.shifted ? b.distance_m : 0);
  for (int row = 0; row < b.rows; ++row)
    for (int column = 0; column < b.columns; ++column)
      out.points.emplace_back(step * column + (b.shifted && row % 2 == 1 ? b.distance_m : 0) - 0.5 * width, 0,
                              b.distance_m * (row - 0.5 * (b.rows - 1)));
  return out;
}

}  // namespace

BoardLattice lattice_of(const Board& board) {
  return std::visit([](const auto& b) { return lattice(b); }, board);
}

Expected<std::unique_ptr<BoardFinder>> make_board_finder(const Board& board) {
  const auto* tags = std::get_if<AprilGrid>(&board);
  auto finder = tags != nullptr ? make_tag_finder(*tags) : make_grid_finder(board);
  if (finder) return finder;
  return Error{"the board",
               text("cannot be looked for: this program was built without ", tags ? "AprilTag" : "OpenCV"),
               text("install ", tags ? "libapriltag-dev" : "libopencv-calib3d-dev",
                    " and build again, or give a start pose with --init")};
}

float full_value(std::span<const float> picture) {
  constexpr double kFull = 0.97;
  std::vector<float> magnitude(picture.size());
  std::ranges::transform(picture, magnitude.begin(), [](float v) { return std::abs(v); });
  const auto full =
      magnitude.begin() + static_cast<std::ptrdiff_t>(kFull * static_cast<double>(picture.size()));
  std::nth_element(magnitude.begin(), full, magnitude.end());
  return *full;
}

std::vector<LatticePixels> orders_from_front(const LatticePixels& grid, int columns, int rows) {
  using Cell = std::pair<int, int>;  // column, row
  const auto in_order = [&](auto source) {
    LatticePixels out;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column) {
        const Cell from = source(column, row);
        out.push_back(grid[static_cast<std::size_t>(from.second) * columns + from.first]);
      }
    return out;
  };
  const auto along = [&](const Cell& a, const Cell& b) -> Eigen::Vector2d {
    const auto at = [&](const Cell& c) {
      return grid[static_cast<std::size_t>(c.second) * columns + c.first];
    };
    return at(b) - at(a);
  };
  const Eigen::Vector2d right = along({0, 0}, {columns - 1, 0}), up = along({0, 0}, {0, rows - 1});
  // Rows of a picture count downwards: seen from the front, up lies to the left of right.
  const bool mirrored = right.x() * up.y() - right.y() * up.x() > 0;
  const auto row_of = [&](int row) { return mirrored ? rows - 1 - row : row; };
  std::vector<LatticePixels> out;
  out.push_back(in_order([&](int c, int r) { return Cell{c, row_of(r)}; }));
  out.push_back(in_order([&](int c, int r) { return Cell{columns - 1 - c, row_of(rows - 1 - r)}; }));
  if (columns != rows) return out;
  out.push_back(in_order([&](int c, int r) { return Cell{rows - 1 - r, row_of(c)}; }));
  out.push_back(in_order([&](int c, int r) { return Cell{r, row_of(columns - 1 - c)}; }));
  return out;
}

double checkers_agree(std::span<const float> picture, ImageSize size, const LatticePixels& corners,
                      int columns, int rows) {
  double sum = 0;
  for (int row = 0; row + 1 < rows; ++row)
    for (int column = 0; column + 1 < columns; ++column) {
      const auto at = [&](int c, int r) { return corners[static_cast<std::size_t>(r) * columns + c]; };
      const Eigen::Vector2d middle =
          0.25 * (at(column, row) + at(column + 1, row) + at(column, row + 1) + at(column + 1, row + 1));
      const Eigen::Vector2i pixel = middle.array().round().cast<int>();
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= size.width || pixel.y() >= size.height) continue;
      // Beyond the corner at the lower left lies the second square of the second row, a dark one.
      const double value = picture[static_cast<std::size_t>(pixel.y()) * size.width + pixel.x()];
      sum += (row + column) % 2 == 0 ? -value : value;
    }
  return sum;
}

}  // namespace evpose
