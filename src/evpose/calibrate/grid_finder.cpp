// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/board_finder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace evpose {
namespace {

constexpr int kLeastWidth = 1000;  // px; squares of 6 px are not found in a picture as it is
constexpr double kBlur_px = 0.7;

/// Grey values, enlarged. `factor`: by how much.
cv::Mat grey_picture(std::span<const float> picture, ImageSize size, int* factor) {
  const float scale = 100 / std::max(full_value(picture), 1e-9F);
  cv::Mat values(size.height, size.width, CV_32F), blurred, enlarged, grey;
  std::ranges::transform(picture, values.begin<float>(), [&](float v) { return 127 + scale * v; });
  cv::GaussianBlur(values, blurred, {}, kBlur_px);
  *factor = (kLeastWidth + size.width - 1) / size.width;
  cv::resize(blurred, enlarged, {}, *factor, *factor, cv::INTER_CUBIC);
  enlarged.convertTo(grey, CV_8U);
  return grey;
}

bool find_points(const Board& board, const BoardLattice& lattice, const cv::Mat& grey,
                 std::vector<cv::Point2f>* found) {
  const cv::Size size(lattice.columns, lattice.rows);
  if (std::holds_alternative<Checkerboard>(board)) {
    // Equalised, faint boards are found as well; pictures of few grey values are not.
    return cv::findChessboardCornersSB(grey, size, *found,
                                       cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_NORMALIZE_IMAGE) ||
           cv::findChessboardCornersSB(grey, size, *found, cv::CALIB_CB_EXHAUSTIVE);
  }
  const auto* circles = std::get_if<CircleGrid>(&board);
  return circles != nullptr &&
         cv::findCirclesGrid(grey, size, *found,
                             circles->shifted ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID);
}

double distance_of(const LatticePixels& a, const LatticePixels& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).squaredNorm();
  return sum;
}

class GridFinder final : public BoardFinder {
 public:
  explicit GridFinder(const Board& board) : board_(board), lattice_(lattice_of(board)) {}

  std::optional<LatticePixels> find(std::span<const float> picture, ImageSize size,
                                    const LatticePixels& last) const override {
    int factor = 1;
    const cv::Mat grey = grey_picture(picture, size, &factor);
    std::vector<cv::Point2f> found;
    if (!find_points(board_, lattice_, grey, &found) || found.size() != lattice_.points.size()) return {};
    LatticePixels pixels;
    for (const cv::Point2f& p : found)
      pixels.push_back((Eigen::Vector2d(p.x, p.y).array() + 0.5) / factor - 0.5);
    std::vector<LatticePixels> orders = orders_from_front(pixels, lattice_.columns, lattice_.rows);
    if (std::holds_alternative<Checkerboard>(board_))
      std::erase_if(orders, [&](const LatticePixels& order) {
        return checkers_agree(picture, size, order, lattice_.columns, lattice_.rows) <= 0;
      });
    const auto cost = [&](const LatticePixels& order) {
      if (!last.empty()) return distance_of(order, last);
      return order.back().y() - order.front().y();  // upper right above lower left
    };
    const auto best = std::ranges::min_element(orders, {}, cost);
    return best == orders.end() ? std::nullopt : std::optional(*best);
  }

 private:
  Board board_;
  BoardLattice lattice_;
};

}  // namespace

std::unique_ptr<BoardFinder> make_grid_finder(const Board& board) {
  return std::make_unique<GridFinder>(board);
}

}  // namespace evpose
