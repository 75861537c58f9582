// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/light_refinement.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace evpose::sim {
namespace {

constexpr int kMostTexels = 4096;  // along a side
constexpr float kUneven = 1.2F;    // ratio of light, the contrast threshold of an event pixel
constexpr float kFaint = 0.02F;    // differences of so much of the brightest place do not count

/// The map on a grid `parts` times as fine.
LightMap interpolated(const LightMap& map, int parts) {
  LightMap fine = map;
  fine.per_metre = map.per_metre * parts;
  fine.columns = (map.columns - 1) * parts + 1;
  fine.rows = (map.rows - 1) * parts + 1;
  const std::size_t texels = static_cast<std::size_t>(map.columns) * map.rows,
                    fine_texels = static_cast<std::size_t>(fine.columns) * fine.rows;
  fine.values.resize(map.values.size() / texels * fine_texels);
  auto out = fine.values.begin();
  for (std::size_t first = 0; first < map.values.size(); first += texels) {
    for (int y = 0; y < fine.rows; ++y) {
      const int row = std::min(y / parts, map.rows - 2);
      const float b = static_cast<float>(y - row * parts) / static_cast<float>(parts);
      for (int x = 0; x < fine.columns; ++x) {
        const int column = std::min(x / parts, map.columns - 2);
        const float a = static_cast<float>(x - column * parts) / static_cast<float>(parts);
        const float* at = &map.values[first + static_cast<std::size_t>(row) * map.columns + column];
        *out++ = (1 - b) * ((1 - a) * at[0] + a * at[1]) +
                 b * ((1 - a) * at[map.columns] + a * at[map.columns + 1]);
      }
    }
  }
  return fine;
}

}  // namespace

LightRefinement::LightRefinement(LightMap& map, double finest_m) : map_(map) {
  const int side = std::max(map.columns, map.rows) - 1;
  if (map.columns < 2 || map.rows < 2) return;
  parts_ = std::min(static_cast<int>(std::ceil(1 / (finest_m * map.per_metre) - 1e-6)), kMostTexels / side);
  if (parts_ < 2) return;
  columns_ = map.columns - 1;
  rows_ = map.rows - 1;
  map_ = interpolated(map, parts_);
  const std::size_t cells = static_cast<std::size_t>(columns_) * rows_,
                    texels = static_cast<std::size_t>(map_.columns) * map_.rows;
  wanted_.assign(cells, false);
  done_.assign(cells, false);
  fine_.assign(texels, false);
  for (std::size_t first = 0; first < map_.values.size(); first += texels)
    peak_.push_back(*std::max_element(&map_.values[first], &map_.values[first] + texels));
}

void LightRefinement::want_cell_at(const Eigen::Vector2d& at) {
  const double per_cell = map_.per_metre / parts_;
  const double column = std::floor((at.x() - map_.right0) * per_cell),
               row = std::floor((at.y() - map_.up0) * per_cell);
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return;
  wanted_[cell(static_cast<int>(column), static_cast<int>(row))] = true;
}

bool LightRefinement::is_uneven(int column, int row) const {
  const std::size_t texels = static_cast<std::size_t>(map_.columns) * map_.rows,
                    corner = static_cast<std::size_t>(row) * parts_ * map_.columns + column * parts_;
  for (std::size_t c = 0; c < peak_.size(); ++c) {
    const float* at = &map_.values[c * texels + corner];
    float low = at[0], high = at[0];
    for (int k = 0; k <= parts_; ++k) {
      for (const int i : {k, parts_ * map_.columns + k, k * map_.columns, k * map_.columns + parts_}) {
        low = std::min(low, at[i]);
        high = std::max(high, at[i]);
      }
    }
    if (high > kUneven * low + kFaint * peak_[c]) return true;
  }
  return false;
}

// Cells whose light may have changed: all at first, then those at the cells that were computed anew.
std::vector<std::size_t> LightRefinement::changed_cells() const {
  std::vector<std::size_t> cells;
  if (!started_) {
    cells.resize(done_.size());
    std::iota(cells.begin(), cells.end(), std::size_t{0});
    return cells;
  }
  for (const std::size_t k : latest_) {
    const int column = static_cast<int>(k % columns_), row = static_cast<int>(k / columns_);
    for (int y = std::max(row - 1, 0); y <= std::min(row + 1, rows_ - 1); ++y)
      for (int x = std::max(column - 1, 0); x <= std::min(column + 1, columns_ - 1); ++x)
        if (!done_[cell(x, y)]) cells.push_back(cell(x, y));
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  return cells;
}

std::vector<std::uint32_t> LightRefinement::next_texels() {
  std::vector<std::uint32_t> texels;
  if (parts_ < 2) return texels;
  const std::vector<std::size_t> changed = changed_cells();
  started_ = true;
  latest_.clear();
  for (const std::size_t k : changed) {
    const int column = static_cast<int>(k % columns_), row = static_cast<int>(k / columns_);
    if (!wanted_[k] && !is_uneven(column, row)) continue;
    done_[k] = true;
    latest_.push_back(k);
    for (int y = row * parts_; y <= (row + 1) * parts_; ++y) {
      for (int x = column * parts_; x <= (column + 1) * parts_; ++x) {
        const std::size_t texel = static_cast<std::size_t>(y) * map_.columns + x;
        if (fine_[texel]) continue;
        fine_[texel] = true;
        texels.push_back(static_cast<std::uint32_t>(texel));
      }
    }
  }
  return texels;
}

}  // namespace evpose::sim
