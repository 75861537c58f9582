// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/board_map.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <functional>
#include <set>
#include <string>

namespace evpose {
namespace {

/// Brightness of a board at a place of it, written down a second time.
using Shade = std::function<int(double x, double z)>;

int checkerboard(const Checkerboard& b, double x, double z) {
  const double column = x / b.square_m + 0.5 * b.columns, row = z / b.square_m + 0.5 * b.rows;
  if (column < 0 || row < 0 || column >= b.columns || row >= b.rows) return 1;
  return (static_cast<int>(column) + static_cast<int>(row)) % 2;
}

int circles(const CircleGrid& b, double x, double z) {
  const double width = b.distance_m * (2 * b.columns - 1), height = b.distance_m * (b.rows - 1);
  for (int row = 0; row < b.rows; ++row)
    for (int column = 0; column < b.columns; ++column) {
      const double cx = b.distance_m * (2 * column + row % 2) - 0.5 * width,
                   cz = b.distance_m * row - 0.5 * height;
      if (std::hypot(x - cx, z - cz) < 0.5 * b.diameter_m) return 0;
    }
  return 1;
}

void expect_edges(const ContourMap& map, const Shade& shade, double step_m) {
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const ContourPoint& p = map.points[i];
    const Eigen::Vector3d at = map.position(i), n = p.normal.cast<double>(), t = p.tangent.cast<double>();
    ASSERT_NEAR(at.y(), 0, 1e-9);
    ASSERT_NEAR(n.dot(t), 0, 1e-6);
    ASSERT_NEAR(n.norm(), 1, 1e-6);
    const Eigen::Vector3d out = at + step_m * n, in = at - step_m * n;
    ASSERT_EQ(shade(out.x(), out.z()) - shade(in.x(), in.z()), p.contrast) << i;
    const Eigen::Vector3d on = out + step_m * t, back = out - step_m * t;
    ASSERT_EQ(shade(on.x(), on.z()), shade(back.x(), back.z())) << i;
  }
}

TEST(BoardMap, ContoursAreWhereTheShadeChanges) {
  const Checkerboard squares{5, 4, 0.03};
  expect_edges(
      *board_map(squares), [&](double x, double z) { return checkerboard(squares, x, z); }, 5e-4);
  const CircleGrid discs{4, 5, 0.04, 0.02, true};
  expect_edges(
      *board_map(discs), [&](double x, double z) { return circles(discs, x, z); }, 5e-4);
}

TEST(BoardMap, LengthIsThatOfAllEdges) {
  const auto length = [](const Board& board) {
    double sum = 0;
    const ContourMap map = *board_map(board);
    for (const auto& p : map.points) sum += static_cast<double>(p.length);
    return sum;
  };
  EXPECT_NEAR(length(Checkerboard{9, 7, 0.08}), 32 * 4 * 0.08, 1e-4);
  EXPECT_NEAR(length(AprilGrid{6, 6, 0.088, 0.3}), 36 * 4 * 0.088 + 49 * 4 * 0.3 * 0.088, 1e-4);
  EXPECT_NEAR(length(CircleGrid{4, 11, 0.04, 0.02, true}), 44 * M_PI * 0.02, 1e-4);
}

/// The contours of a board that is turned about its normal.
std::set<std::array<long, 4>> turned(const Board& board, double angle) {
  std::set<std::array<long, 4>> out;
  const Eigen::AngleAxisf turn(static_cast<float>(angle), Eigen::Vector3f::UnitY());
  const ContourMap map = *board_map(board);
  for (const auto& p : map.points) {
    const Eigen::Vector3f at = 1e5F * (turn * p.position), n = turn * p.normal;
    const auto rounded = [](float v) { return std::lround(0.1F * v); };
    out.insert({rounded(at.x() + 3.3F), rounded(at.z() + 3.3F), rounded(1e3F * n.x() + 3.3F),
                rounded(1e3F * n.z() + 3.3F)});
  }
  return out;
}

TEST(BoardMap, SaysHowItMayBeTurned) {
  const Board boards[] = {Checkerboard{9, 7, 0.08},
                          Checkerboard{7, 10, 0.027},
                          Checkerboard{5, 5, 0.05},
                          Checkerboard{6, 6, 0.05},
                          AprilGrid{6, 6, 0.08, 0.3},
                          AprilGrid{6, 4, 0.08, 0.3},
                          CircleGrid{4, 11, 0.04, 0.02, true},
                          CircleGrid{4, 6, 0.04, 0.02, true},
                          CircleGrid{5, 7, 0.04, 0.02, false}};
  for (const Board& board : boards) {
    const auto upright = turned(board, 0);
    const bool half = upright == turned(board, M_PI), quarter = upright == turned(board, M_PI / 2);
    const std::string said = board_symmetry(board);
    EXPECT_EQ(said, quarter ? "turned by 90 degrees" : half ? "turned by 180 degrees" : "");
  }
}

TEST(BoardMap, WhatIsNoBoardIsRefused) {
  EXPECT_FALSE(board_map(Checkerboard{1, 7, 0.08}).ok());
  EXPECT_FALSE(board_map(Checkerboard{9, 7, -0.08}).ok());
  EXPECT_FALSE(board_map(Checkerboard{9, 100000, 0.08}).ok());
  EXPECT_FALSE(board_map(AprilGrid{6, 6, 0.08, 0}).ok());
  EXPECT_FALSE(board_map(CircleGrid{4, 11, 0.04, 0.05, false}).ok());
}

}  // namespace
}  // namespace evpose
