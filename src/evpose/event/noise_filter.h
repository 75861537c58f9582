// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evpose/core/huge_pages.h"
#include "evpose/core/time.h"

namespace evpose {

class ConfigTable;

struct NoiseFilterConfig {
  bool on = true;
  double support_px = 1.0;       ///< a neighbour's event supports for this much predicted motion, px
  double support_min_s = 2e-3;   ///< shortest time of support
  double support_max_s = 30e-3;  ///< longest time of support; equal to the shortest: the paper's constant
};
void describe(ConfigTable& table, NoiseFilterConfig& config);

/// Spatio-temporal consistency (EV-Pose 4.1): an event is kept if the newest event among its eight neighbours
/// is at most `support` old. Pixels that fire on without such support are found once a second and masked.
class NoiseFilter {
 public:
  NoiseFilter(int width, int height, const NoiseFilterConfig& config);

  /// Length of the support window from the predicted image motion, px/s: the window is a length in the image,
  /// turned into time, so that it means the same at every speed.
  void set_motion(double flow_px_per_s);

  /// True if the event is to be kept. O(1), but for a band of rows, of which each is looked through once a
  /// second. Pixel inside the image.
  bool keep(int x, int y, std::uint32_t stamp_us) {
    if (stamp_us >= next_band_us_) judge_bands(stamp_us);
    Cell& cell = cells_[index(x, y)];
    if (cell.unsupported == kMasked) return false;
    const bool supported = newest_neighbour(&cell) + support_us_ >= stamp_us;
    cell.last = stamp_us;
    if (cell.seen != 0xFFFF) ++cell.seen;
    if (!supported && cell.unsupported != kMasked - 1) ++cell.unsupported;
    return supported || !config_.on;
  }

  /// Brings what keep() reads for this pixel near. Pixel inside the image.
  void prefetch(int x, int y) const {
    const Cell* const cell = &cells_[index(x, y)];
    __builtin_prefetch(cell - stride_);
    __builtin_prefetch(cell, 1);
    __builtin_prefetch(cell + stride_);
  }

  struct Pixel {
    int x, y;
  };
  /// Masked so far, in the order in which they were found.
  const std::vector<Pixel>& hot_pixels() const { return hot_; }

  void rebase(std::uint32_t shift_us);

 private:
  static constexpr std::uint16_t kMasked = 0xFFFF;
  /// Together, so that an event touches three lines of memory and no more.
  struct Cell {
    std::uint32_t last = 0;
    std::uint16_t seen = 0, unsupported = 0;  ///< events this second of its band; kMasked: of a hot pixel
  };

  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + 1) * stride_ + static_cast<std::size_t>(x + 1);
  }
  std::uint32_t newest_neighbour(const Cell* row) const {
    const Cell* const up = row - stride_;
    const Cell* const down = row + stride_;
    const auto later = [](std::uint32_t a, std::uint32_t b) { return a > b ? a : b; };
    const std::uint32_t a = later(later(up[-1].last, up[0].last), later(up[1].last, row[-1].last));
    const std::uint32_t b = later(later(down[-1].last, down[0].last), later(down[1].last, row[1].last));
    const std::uint32_t newest = later(a, b);
    // "Never" must not support the first moments of the clock.
    return newest == 0 ? 0 - support_us_ : newest;
  }
  /// Numbers of pixels by the events that they had in a second, active ones.
  using Histogram = std::array<std::uint32_t, 256>;
  void judge_bands(std::uint32_t stamp_us);
  void end_second_of(int band);
  double median_of_active() const;

  NoiseFilterConfig config_;
  int width_, height_;
  std::size_t stride_;
  std::uint32_t support_us_;
  static constexpr int kBands = 64;  ///< each gets its turn in a second, so that no event waits for all
  int next_band_ = 0;
  std::uint32_t next_band_us_ = 0;
  bool judging_ = false;            ///< each band has counted for a second
  Histogram last_ = {}, now_ = {};  ///< of the last round over the bands, and of this one
  RandomAccessTable<Cell> cells_;   ///< with a border of one pixel
  std::vector<Pixel> hot_;
};

}  // namespace evpose
