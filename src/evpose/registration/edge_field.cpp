// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/edge_field.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr int kWideImage_px = 800;       // from here on two pixels make one cell, which bounds the cost
constexpr int kPatch_cells = 3;          // to each side, whose active cells tell an edge's direction
constexpr int kLeastCells = 5;           // active ones; fewer do not tell a direction
constexpr double kLeastLinearity = 0.5;  // (l1 - l0) / (l1 + l0) of the eigenvalues of their scatter
constexpr int kBlock_cells = 16;         // the background is averaged over 5 x 5 blocks of this edge
constexpr int kNeighbourBlocks = 2;
constexpr float kLeastBackground = 0.01F;  // bounds the weight of a lone edge
constexpr float kCoarse_px = 6;            // reaches from one random guess to the next
constexpr float kFine_px = 1.5F;  // what a slice of some milliseconds leaves of a contour's sharpness

}  // namespace

float EdgeField::spread_px(EdgeSpread spread) { return spread == EdgeSpread::coarse ? kCoarse_px : kFine_px; }

EdgeField::EdgeField(ImageSize size)
    : size_(size),
      cell_(size.width > kWideImage_px ? 2 : 1),
      columns_((size.width + cell_ - 1) / cell_),
      rows_((size.height + cell_ - 1) / cell_),
      block_columns_((columns_ + kBlock_cells - 1) / kBlock_cells),
      block_rows_((rows_ + kBlock_cells - 1) / kBlock_cells) {
  const std::size_t n = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  active_.resize(n);
  for (Plane& plane : planes_) plane.resize(n);
  for (auto& spread : background_)
    for (Plane& plane : spread)
      plane.resize(static_cast<std::size_t>(block_columns_) * static_cast<std::size_t>(block_rows_));
}

int EdgeField::direction(double x, double y) {
  const double turn = std::atan2(y, x) / M_PI;  // -1 .. 1, lines repeat after 1
  return static_cast<int>(std::floor((turn + 1) * kDirections + 0.5)) % kDirections;
}

void EdgeField::build(std::span<const FilteredEvent> events) {
  std::fill(active_.begin(), active_.end(), std::uint8_t{0});
  for (const FilteredEvent& e : events)
    active_[static_cast<std::size_t>(e.y / cell_) * static_cast<std::size_t>(columns_) +
            static_cast<std::size_t>(e.x / cell_)] = 1;
  for (Plane& plane : planes_) std::fill(plane.begin(), plane.end(), kReach_px);
  for (int row = kPatch_cells; row < rows_ - kPatch_cells; ++row)
    for (int column = kPatch_cells; column < columns_ - kPatch_cells; ++column) mark_edge(column, row);
  for (Plane& plane : planes_) transform_distances(plane);
  for (const EdgeSpread spread : {EdgeSpread::coarse, EdgeSpread::fine}) average_background(spread);
}

void EdgeField::mark_edge(int column, int row) {
  const std::size_t here =
      static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  if (!active_[here]) return;
  int n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  for (int y = -kPatch_cells; y <= kPatch_cells; ++y)
    for (int x = -kPatch_cells; x <= kPatch_cells; ++x)
      if (active_[here + static_cast<std::size_t>(y * columns_ + x)])
        ++n, sx += x, sy += y, sxx += x * x, sxy += x * y, syy += y * y;
  if (n < kLeastCells) return;
  const double mx = static_cast<double>(sx) / n, my = static_cast<double>(sy) / n;
  const double a = static_cast<double>(sxx) / n - mx * mx, b = static_cast<double>(sxy) / n - mx * my,
               c = static_cast<double>(syy) / n - my * my;
  const double difference = std::hypot(a - c, 2 * b);
  if (difference < kLeastLinearity * (a + c)) return;
  const double angle = 0.5 * std::atan2(2 * b, a - c);
  const int middle = direction(std::cos(angle), std::sin(angle));
  for (int k = -1; k <= 1; ++k)
    planes_[static_cast<std::size_t>((middle + k + kDirections) % kDirections)][here] = 0;
}

/// Chamfer distances, two passes.
void EdgeField::transform_distances(Plane& plane) const {
  const auto straight = static_cast<float>(cell_), diagonal = static_cast<float>(M_SQRT2) * straight;
  const auto at = [&](int x, int y) -> float& {
    return plane[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) +
                 static_cast<std::size_t>(x)];
  };
  for (int y = 1; y < rows_; ++y)
    for (int x = 1; x < columns_ - 1; ++x)
      at(x, y) = std::min({at(x, y), at(x - 1, y) + straight, at(x, y - 1) + straight,
                           at(x - 1, y - 1) + diagonal, at(x + 1, y - 1) + diagonal});
  for (int y = rows_ - 2; y >= 0; --y)
    for (int x = columns_ - 2; x >= 1; --x)
      at(x, y) = std::min({at(x, y), at(x + 1, y) + straight, at(x, y + 1) + straight,
                           at(x + 1, y + 1) + diagonal, at(x - 1, y + 1) + diagonal});
}

/// Sums of the likelihood over the cells of each block.
EdgeField::Plane EdgeField::sum_blocks(int direction, EdgeSpread spread) const {
  // Likelihood by distance, in quarters of a pixel.
  std::array<float, static_cast<std::size_t>(kReach_px * 4) + 2> likelihood;
  for (std::size_t i = 0; i < likelihood.size(); ++i) {
    const float d = static_cast<float>(i) / 4 / spread_px(spread);
    likelihood[i] = std::exp(-0.5F * d * d);
  }
  Plane sums(static_cast<std::size_t>(block_columns_) * static_cast<std::size_t>(block_rows_));
  for (int y = 0; y < rows_; ++y)
    for (int x = 0; x < columns_; ++x)
      sums[static_cast<std::size_t>(y / kBlock_cells) * static_cast<std::size_t>(block_columns_) +
           static_cast<std::size_t>(x / kBlock_cells)] +=
          likelihood[static_cast<std::size_t>(4 * at(x, y, direction))];
  return sums;
}

void EdgeField::average_background(EdgeSpread spread) {
  for (int k = 0; k < kDirections; ++k) {
    const Plane sums = sum_blocks(k, spread);
    Plane& means = background_[static_cast<std::size_t>(spread)][static_cast<std::size_t>(k)];
    for (int y = 0; y < block_rows_; ++y)
      for (int x = 0; x < block_columns_; ++x) {
        float sum = 0;
        int cells = 0;
        for (int v = std::max(0, y - kNeighbourBlocks); v <= std::min(block_rows_ - 1, y + kNeighbourBlocks);
             ++v)
          for (int u = std::max(0, x - kNeighbourBlocks);
               u <= std::min(block_columns_ - 1, x + kNeighbourBlocks); ++u) {
            sum += sums[static_cast<std::size_t>(v) * static_cast<std::size_t>(block_columns_) +
                        static_cast<std::size_t>(u)];
            cells += std::min(kBlock_cells, columns_ - u * kBlock_cells) *
                     std::min(kBlock_cells, rows_ - v * kBlock_cells);
          }
        means[static_cast<std::size_t>(y) * static_cast<std::size_t>(block_columns_) +
              static_cast<std::size_t>(x)] = std::max(kLeastBackground, sum / static_cast<float>(cells));
      }
  }
}

EdgeField::Sample EdgeField::sample(double x, double y, int direction) const {
  const double u = std::clamp(x / cell_, 0.0, columns_ - 1.001),
               v = std::clamp(y / cell_, 0.0, rows_ - 1.001);
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  const auto fx = static_cast<float>(u - column), fy = static_cast<float>(v - row);
  const float a = at(column, row, direction), b = at(column + 1, row, direction),
              c = at(column, row + 1, direction), d = at(column + 1, row + 1, direction);
  const auto cell = static_cast<float>(cell_);
  return {(a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy,
          ((b - a) * (1 - fy) + (d - c) * fy) / cell, ((c - a) * (1 - fx) + (d - b) * fx) / cell};
}

float EdgeField::background(double x, double y, int direction, EdgeSpread spread) const {
  const int column = std::clamp(static_cast<int>(x) / cell_ / kBlock_cells, 0, block_columns_ - 1),
            row = std::clamp(static_cast<int>(y) / cell_ / kBlock_cells, 0, block_rows_ - 1);
  return background_[static_cast<std::size_t>(spread)][static_cast<std::size_t>(direction)]
                    [static_cast<std::size_t>(row) * static_cast<std::size_t>(block_columns_) +
                     static_cast<std::size_t>(column)];
}

float EdgeField::likelihood_ratio(double x, double y, int direction, EdgeSpread spread) const {
  const int column = std::clamp(static_cast<int>(std::lround(x)) / cell_, 0, columns_ - 1),
            row = std::clamp(static_cast<int>(std::lround(y)) / cell_, 0, rows_ - 1);
  const float d = at(column, row, direction) / spread_px(spread);
  return std::exp(-0.5F * d * d) / background(x, y, direction, spread);
}

}  // namespace evpose
