// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "evpose/core/huge_pages.h"
#include "evpose/core/time.h"

namespace evpose {

/// Microseconds on a 32-bit clock that is moved along with the data; 0 means "never".
/// Shared by filter and surfaces, so that a stamp is made once per event.
class StampClock {
 public:
  static constexpr std::int64_t kLargest = 0x7FFFFFFF;  ///< stamp

  /// Stamp of a time; at least 1. `rebase` is called with the amount to subtract from every stored stamp when
  /// the clock has moved so far that stamps would overflow (about every half hour of data).
  template <class Rebase>
  std::uint32_t stamp(TimeNs t, Rebase&& rebase) {
    if (!started_) start(t);
    std::int64_t us = (t - zero_) / kNsPerUs;
    if (us > kLargest) {
      const std::int64_t shift = us - kKept;
      rebase(static_cast<std::uint32_t>(shift > kLargest ? kLargest : shift));
      zero_ += shift * kNsPerUs;
      us -= shift;
    }
    return us < 1 ? 1u : static_cast<std::uint32_t>(us);
  }
  /// Microseconds on the clock, not clamped, rounded down; the clock starts at the first time it hears of.
  std::int64_t microseconds(TimeNs t) {
    if (!started_) start(t);
    const std::int64_t ns = t - zero_;
    return ns / kNsPerUs - (ns % kNsPerUs < 0 ? 1 : 0);
  }
  /// Stamp for reading only: clamped to the clock's range.
  std::uint32_t at(TimeNs t) const {
    const std::int64_t us = (t - zero_) / kNsPerUs;
    return us < 0 ? 0u : us > 0xFFFFFFFFll ? 0xFFFFFFFFu : static_cast<std::uint32_t>(us);
  }

 private:
  static constexpr std::int64_t kKept = 60'000'000;  ///< a minute of history survives a rebase
  static constexpr std::int64_t kLeadIn = 1;         ///< the first stamp must not be 0
  void start(TimeNs t) {
    zero_ = t - kLeadIn * kNsPerUs;
    started_ = true;
  }
  TimeNs zero_ = 0;
  bool started_ = false;
};

/// Subtracts `shift` from every stamp; those that would pass zero become "never".
void rebase_stamps(std::vector<std::uint32_t>& stamps, std::uint32_t shift);

enum class Polarity : std::uint8_t { off = 0, on = 1 };

/// Separated-polarity time surface (EV-Pose 4.1): per polarity and pixel, the time of the last event.
/// T(x, t) = exp(-(t - last(x)) / eta) is evaluated only where it is read. A border of `kBorder` pixels lets
/// readers take small patches around any pixel of the image unchecked.
class TimeSurface {
 public:
  static constexpr int kBorder = 4;

  TimeSurface(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }

  /// O(1). Pixel inside the image.
  void insert(int x, int y, Polarity polarity, std::uint32_t stamp_us) {
    last_[static_cast<int>(polarity)][index(x, y)] = stamp_us;
  }

  /// Stamp of the last event, 0 if none. Valid up to kBorder pixels outside of the image (always 0 there).
  std::uint32_t last(int x, int y, Polarity polarity) const {
    return last_[static_cast<int>(polarity)][index(x, y)];
  }

  void rebase(std::uint32_t shift_us);

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + kBorder) * stride_ + static_cast<std::size_t>(x + kBorder);
  }
  int width_, height_;
  std::size_t stride_;
  RandomAccessTable<std::uint32_t> last_[2];
};

}  // namespace evpose
