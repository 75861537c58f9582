// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace evpose {

/// The part of the image in which events can matter, in cells of a bit each: small enough for the first
/// cache, so that most events cost no more than a look at it.
class InterestMap {
 public:
  static constexpr int kCell_px = 4;

  InterestMap(int width, int height);

  int columns() const { return columns_; }
  int rows() const { return rows_; }

  void clear();
  /// Columns `first` to `last` of a row, inside the image.
  void mark(int row, int first, int last);

  /// Any coordinates; false outside of the image.
  bool holds(std::uint32_t x, std::uint32_t y) const {
    const bool inside = (x < width_) & (y < height_);
    const std::size_t at = inside ? (y / kCell_px) * words_ + x / (kCell_px * 64) : 0;
    return inside & ((bits_[at] >> (x / kCell_px % 64)) & 1U);
  }
  /// Marked share of the cells.
  double share() const;

 private:
  std::uint32_t width_, height_;
  int columns_, rows_;
  std::size_t words_;  ///< of a row
  std::vector<std::uint64_t> bits_;
};

}  // namespace evpose
