// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/board_finder.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/calibrate/event_image.h"

namespace evpose {
namespace {

constexpr ImageSize kSize{320, 240};

/// Seen from its front, turned by `turn_rad` in the picture.
Eigen::Vector2d pixel_of(const Eigen::Vector3d& p, double turn_rad) {
  const Eigen::Vector2d in_plane = Eigen::Rotation2Dd(-turn_rad) * Eigen::Vector2d(300 * p.x(), -300 * p.z());
  return in_plane / (1 + 0.1 * p.x()) + Eigen::Vector2d(161, 118);
}

/// Brightness of the checkerboard at a place of it: -1, 1 beside the squares, too.
double shade(const Checkerboard& b, double x, double z) {
  const double column = x / b.square_m + 0.5 * b.columns, row = z / b.square_m + 0.5 * b.rows;
  if (column < 0 || row < 0 || column >= b.columns || row >= b.rows) return 1;
  return (static_cast<int>(column) + static_cast<int>(row)) % 2 == 0 ? -1 : 1;
}

/// Means over the pixels of what is drawn there, more finely than they are; bright elsewhere.
class Drawing {
 public:
  void add(const Eigen::Vector3d& at, double turn_rad, double value) {
    const Eigen::Vector2i pixel = pixel_of(at, turn_rad).array().round().cast<int>();
    const auto i = static_cast<std::size_t>(pixel.y()) * kSize.width + pixel.x();
    sum_[i] += value;
    ++count_[i];
  }
  std::vector<float> picture() const {
    std::vector<float> out(sum_.size(), 1.0F);
    for (std::size_t i = 0; i < out.size(); ++i)
      if (count_[i] > 0) out[i] = static_cast<float>(sum_[i] / count_[i]);
    return out;
  }

 private:
  static constexpr std::size_t kPixels = static_cast<std::size_t>(kSize.width) * kSize.height;
  std::vector<double> sum_ = std::vector<double>(kPixels), count_ = sum_;
};

constexpr int kFine = 1500;  // places along each side of a board

std::vector<float> picture_of(const Checkerboard& b, double turn_rad) {
  Drawing drawing;
  const double width = b.square_m * (b.columns + 1), height = b.square_m * (b.rows + 1);
  for (int i = 0; i < kFine; ++i)
    for (int j = 0; j < kFine; ++j) {
      const double x = width * ((i + 0.5) / kFine - 0.5), z = height * ((j + 0.5) / kFine - 0.5);
      drawing.add({x, 0, z}, turn_rad, shade(b, x, z));
    }
  return drawing.picture();
}

std::vector<float> picture_of(const CircleGrid& b, const BoardLattice& lattice, double turn_rad) {
  Drawing drawing;
  for (const Eigen::Vector3d& middle : lattice.points)
    for (int i = -100; i <= 100; ++i)
      for (int k = -100; k <= 100; ++k) {
        const Eigen::Vector3d from_middle = 0.01 * b.diameter_m * Eigen::Vector3d(i, 0, k);
        if (from_middle.norm() < 0.95 * b.diameter_m)
          drawing.add(middle + from_middle, turn_rad, from_middle.norm() < 0.5 * b.diameter_m ? -1 : 1);
      }
  return drawing.picture();
}

LatticePixels pixels_of(const BoardLattice& lattice, double turn_rad) {
  LatticePixels out;
  for (const Eigen::Vector3d& p : lattice.points) out.push_back(pixel_of(p, turn_rad));
  return out;
}

double furthest(const LatticePixels& a, const LatticePixels& b) {
  double out = 0;
  for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, (a[i] - b[i]).norm());
  return out;
}

TEST(BoardFinder, OneOfTheOrdersIsTheBoards) {
  for (const Checkerboard& board : {Checkerboard{6, 4, 0.08}, Checkerboard{6, 6, 0.08}}) {
    const BoardLattice lattice = lattice_of(board);
    const int columns = lattice.columns, rows = lattice.rows;
    const LatticePixels truth = pixels_of(lattice, 0.3);
    // As found: from the upper left, from the lower right, mirrored.
    for (const auto& [flip_columns, flip_rows] :
         {std::pair(false, false), {true, true}, {false, true}, {true, false}}) {
      LatticePixels found;
      for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c)
          found.push_back(truth[static_cast<std::size_t>(flip_rows ? rows - 1 - r : r) * columns +
                                (flip_columns ? columns - 1 - c : c)]);
      const auto orders = orders_from_front(found, columns, rows);
      EXPECT_EQ(orders.size(), columns == rows ? 4u : 2u);
      int right = 0;
      for (const LatticePixels& order : orders) right += furthest(order, truth) < 1e-9 ? 1 : 0;
      EXPECT_EQ(right, 1);
    }
  }
}

TEST(BoardFinder, CheckersAgreeInTheRightOrderAlone) {
  const Checkerboard board{7, 4, 0.08};  // an odd sum: turned, dark cells lie on bright ones
  const BoardLattice lattice = lattice_of(board);
  const auto picture = picture_of(board, 0.2);
  LatticePixels order = pixels_of(lattice, 0.2);
  EXPECT_GT(checkers_agree(picture, kSize, order, lattice.columns, lattice.rows), 0);
  std::reverse(order.begin(), order.end());
  EXPECT_LT(checkers_agree(picture, kSize, order, lattice.columns, lattice.rows), 0);
}

TEST(BoardFinder, FindsCornersWhereTheyAre) {
  if (!make_grid_finder(Checkerboard{})) GTEST_SKIP() << "built without OpenCV";
  const Checkerboard odd{8, 5, 0.09}, even{9, 7, 0.06};
  for (const Checkerboard& board : {odd, even}) {
    const BoardLattice lattice = lattice_of(board);
    const auto finder = make_grid_finder(board);
    for (const double turn_rad : {0.0, 0.4, 2.9}) {
      const LatticePixels truth = pixels_of(lattice, turn_rad);
      // A board that looks the same upside down is found upright, or as it was last.
      const auto found =
          finder->find(picture_of(board, turn_rad), kSize, board == even ? truth : LatticePixels());
      ASSERT_TRUE(found.has_value()) << turn_rad;
      EXPECT_LT(furthest(*found, truth), 0.3) << turn_rad;
    }
  }
  const auto upright = make_grid_finder(even)->find(picture_of(even, 2.9), kSize, {});
  ASSERT_TRUE(upright.has_value());
  EXPECT_LT(upright->back().y(), upright->front().y());
}

TEST(BoardFinder, FindsDiscsWhereTheyAre) {
  if (!make_grid_finder(Checkerboard{})) GTEST_SKIP() << "built without OpenCV";
  for (const CircleGrid& board : {CircleGrid{7, 5, 0.1, 0.05, false}, CircleGrid{4, 9, 0.07, 0.05, true}}) {
    const BoardLattice lattice = lattice_of(board);
    const LatticePixels truth = pixels_of(lattice, 0.1);
    const auto found = make_grid_finder(board)->find(picture_of(board, lattice, 0.1), kSize, {});
    ASSERT_TRUE(found.has_value()) << board.shifted;
    EXPECT_LT(furthest(*found, truth), 0.4) << board.shifted;
  }
}

TEST(BoardFinder, FindsTagsWhereTheyAre) {
  const AprilGrid board{2, 2, 0.2, 0.3};
  const auto finder = make_tag_finder(board);
  if (!finder) GTEST_SKIP() << "built without AprilTag";
  // Of tags 0 to 3, the inner 6 x 6 cells from the upper left, row by row: 1 is white.
  const char* const bits[4] = {"110101011101011000101000010110000100", "110110010111111100011000101101001001",
                               "110111010010100000001001000100001110",
                               "111001000111100111101001110010011000"};
  const BoardLattice lattice = lattice_of(board);
  for (const double turn_rad : {0.0, 0.5}) {
    Drawing drawing;
    for (std::size_t tag = 0; tag < 4; ++tag) {
      const Eigen::Vector3d corner = lattice.points[4 * tag];  // lower left
      for (int i = -60; i < 860; ++i)
        for (int k = -60; k < 860; ++k) {
          const Eigen::Vector3d p = corner + board.tag_m / 800 * Eigen::Vector3d(i + 0.5, 0, k + 0.5);
          const int column = static_cast<int>(std::floor(i / 100.0)) - 1,
                    row = 6 - static_cast<int>(std::floor(k / 100.0));
          const bool outside = i < 0 || k < 0 || i >= 800 || k >= 800;
          const bool inside = column >= 0 && row >= 0 && column < 6 && row < 6;
          const bool white = outside || (inside && bits[tag][6 * row + column] == '1');
          drawing.add(p, turn_rad, white ? 1 : -1);
        }
    }
    const auto found = finder->find(drawing.picture(), kSize, {});
    ASSERT_TRUE(found.has_value()) << turn_rad;
    EXPECT_LT(furthest(*found, pixels_of(lattice, turn_rad)), 0.5) << turn_rad;
  }
}

TEST(BoardFinder, NothingIsFoundInNothing) {
  const std::vector<float> grey(static_cast<std::size_t>(kSize.width) * kSize.height, 0.0F);
  for (const Board& board : {Board(Checkerboard{}), Board(AprilGrid{})}) {
    const auto finder = make_board_finder(board);
    if (finder) {
      EXPECT_FALSE((*finder)->find(grey, kSize, {}).has_value());
    }
  }
}

TEST(EventImage, KeepsTheSignOfWhatHasPassedForAWhile) {
  EventImage image({8, 4});
  EventPacket packet;
  for (int x = 0; x < 8; ++x)
    packet.events.push_back(make_event(static_cast<std::uint32_t>(10'000 * x), x, 1, x % 2 == 0));
  packet.events.push_back(make_event(80'000, 9, 1, true));  // outside
  image.add(packet);
  const auto now = image.at(80 * kNsPerMs), later = image.at(580 * kNsPerMs);
  for (int x = 0; x < 8; ++x) {
    const auto i = static_cast<std::size_t>(8 + x);
    EXPECT_EQ(now[i] > 0, x % 2 == 0);
    EXPECT_NEAR(later[i] / now[i], std::exp(-0.5 / 0.2), 1e-4);
    EXPECT_EQ(now[i - 8], 0);
  }
  EXPECT_GT(std::abs(now[8 + 7]), std::abs(now[8]));
}

}  // namespace
}  // namespace evpose
