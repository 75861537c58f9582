// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/event/interest_map.h"

#include <algorithm>
#include <bit>

#include "evpose/core/error.h"

namespace evpose {

InterestMap::InterestMap(int width, int height)
    : width_(static_cast<std::uint32_t>(width)),
      height_(static_cast<std::uint32_t>(height)),
      columns_((width + kCell_px - 1) / kCell_px),
      rows_((height + kCell_px - 1) / kCell_px),
      words_(static_cast<std::size_t>(columns_ + 63) / 64) {
  EVPOSE_CHECK(width > 0 && height > 0);
  bits_.resize(words_ * static_cast<std::size_t>(rows_));
}

void InterestMap::clear() { std::fill(bits_.begin(), bits_.end(), 0); }

void InterestMap::mark(int row, int first, int last) {
  std::uint64_t* const words = &bits_[static_cast<std::size_t>(row) * words_];
  for (int column = first; column <= last;) {
    const int bit = column % 64, count = std::min(64 - bit, last - column + 1);
    words[column / 64] |= (~std::uint64_t{0} >> (64 - count)) << bit;
    column += count;
  }
}

double InterestMap::share() const {
  int marked = 0;
  for (const std::uint64_t word : bits_) marked += std::popcount(word);
  return static_cast<double>(marked) / (static_cast<double>(columns_) * rows_);
}

}  // namespace evpose
