// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/core/time.h"

namespace evpose {

class ConfigTable;

struct NoiseFilterConfig {
  bool on = true;
  double support_px = 1.0;       ///< a neighbour's event supports for this much predicted motion, px
  double support_min_s = 2e-3;   ///< ... but at least this long
  double support_max_s = 30e-3;  ///< ... and at most
  bool same_polarity = false;    ///< support only by events of the same polarity
  double hot_factor = 20;        ///< a pixel with more unsupported events than this times the median is hot
  int hot_min_events = 20;       ///< ... if it had at least so many within the second
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

  /// True if the event is to be kept. O(1) but for one pass over the pixels a second. Pixel inside the image.
  bool keep(int x, int y, bool on, std::uint32_t stamp_us) {
    if (stamp_us >= second_end_us_) end_second(stamp_us);
    const std::size_t i = static_cast<std::size_t>(y + 1) * stride_ + static_cast<std::size_t>(x + 1);
    if (masked_[i]) return false;
    std::uint32_t* const last = config_.same_polarity && on ? last_on_.data() : last_.data();
    const bool supported = newest_neighbour(last, i) + support_us_ >= stamp_us;
    last[i] = stamp_us;
    if (seen_[i] != 0xFFFF) ++seen_[i];
    if (!supported && unsupported_[i] != 0xFFFF) ++unsupported_[i];
    return supported || !config_.on;
  }

  struct Pixel {
    int x, y;
  };
  /// Masked so far, in row order of the second in which they were found.
  const std::vector<Pixel>& hot_pixels() const { return hot_; }

  void rebase(std::uint32_t shift_us);

 private:
  std::uint32_t newest_neighbour(const std::uint32_t* last, std::size_t i) const {
    const std::uint32_t* const up = last + i - stride_;
    const std::uint32_t* const row = last + i;
    const std::uint32_t* const down = last + i + stride_;
    const auto later = [](std::uint32_t a, std::uint32_t b) { return a > b ? a : b; };
    const std::uint32_t a = later(later(up[-1], up[0]), later(up[1], row[-1]));
    const std::uint32_t b = later(later(down[-1], down[0]), later(down[1], row[1]));
    const std::uint32_t newest = later(a, b);
    // "Never" must not support the first moments of the clock.
    return newest == 0 ? 0 - support_us_ : newest;
  }
  void end_second(std::uint32_t stamp_us);

  NoiseFilterConfig config_;
  int width_, height_;
  std::size_t stride_;
  std::uint32_t support_us_;
  std::uint32_t second_end_us_ = 0;
  std::vector<std::uint32_t> last_, last_on_;  ///< with a border of one pixel; last_on_ only if same_polarity
  std::vector<std::uint16_t> seen_, unsupported_;  ///< this second, per pixel
  std::vector<std::uint8_t> masked_;
  std::vector<Pixel> hot_;
};

}  // namespace evpose
