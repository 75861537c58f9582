// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace evpose::map_learn {

/// Counts over a grid of square cells; cell (x, y) is centred at whole numbers.
struct CountImage {
  int width = 0, height = 0;
  std::vector<float> counts;  ///< row by row

  float at(int x, int y) const {
    return counts[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

/// A straight ridge of counts, in cells.
struct RidgeLine {
  Eigen::Vector2d a, b;     ///< its ends
  double contrast = 0;      ///< peak over what lies beside it, counts a cell
  double significance = 0;  ///< of the whole line, in sigmas of counting
};

struct LineDetectorConfig {
  double blur_cells = 1.1;
  double least_length = 10, most_length = 24;  ///< cells
  double least_contrast = 0.35;                ///< share of the peak
  double least_significance = 4;               ///< of a cell of the ridge, sigmas of counting
};

/// Straight pieces of ridges, the most significant first. Of pieces that run side by side within
/// `apart_cells`, the most significant.
std::vector<RidgeLine> detect_lines(const CountImage& image, const LineDetectorConfig& config,
                                    double apart_cells);

}  // namespace evpose::map_learn
