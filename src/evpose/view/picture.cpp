// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/picture.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace evpose {
namespace {

constexpr int kWidest = 480;  // px

void put(std::string& out, auto value) { out.append(reinterpret_cast<const char*>(&value), sizeof value); }

/// The newest events of square blocks of pixels, as shades.
class BlockShades {
 public:
  BlockShades(const TimeSurface& surface, std::uint32_t now_us, int step)
      : surface_(surface), now_us_(now_us), step_(step) {
    for (std::size_t i = 0; i < shade_.size(); ++i)
      shade_[i] = static_cast<int>(
          std::lround(127 * std::exp(-1e-6 * static_cast<double>(i << kAgeBits) / kPictureDecay_s)));
  }

  char at(int column, int row) const {
    std::uint32_t on = 0, off = 0;
    for (int y = row * step_; y < (row + 1) * step_; ++y)
      for (int x = column * step_; x < (column + 1) * step_; ++x) {
        on = std::max(on, surface_.last(x, y, Polarity::on));
        off = std::max(off, surface_.last(x, y, Polarity::off));
      }
    const int shade = shade_of(std::max(on, off));
    return static_cast<char>(static_cast<unsigned char>(on >= off ? 128 + shade : 128 - shade));
  }

 private:
  static constexpr int kAgeBits = 10;  // steps of 1.024 ms

  int shade_of(std::uint32_t last) const {
    if (last == 0) return 0;
    const std::size_t age = (now_us_ > last ? now_us_ - last : 0) >> kAgeBits;
    return shade_[std::min(age, shade_.size() - 1)];
  }

  const TimeSurface& surface_;
  std::uint32_t now_us_;
  int step_;
  std::array<int, 128> shade_{};
};

}  // namespace

std::string picture_bytes(const TimeSurface& surface, std::uint32_t now_us,
                          std::span<const Snapshot::Point> points, double t_s) {
  const int step = (surface.width() + kWidest - 1) / kWidest;
  const int width = surface.width() / step, height = surface.height() / step;
  std::string out;
  out.reserve(20 + static_cast<std::size_t>(width) * static_cast<std::size_t>(height) + 12 * points.size());
  put(out, static_cast<std::uint32_t>(width));
  put(out, static_cast<std::uint32_t>(height));
  put(out, static_cast<std::uint32_t>(points.size()));
  put(out, static_cast<float>(t_s));
  const BlockShades shades(surface, now_us, step);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) out += shades.at(x, y);
  out.resize((out.size() + 3) / 4 * 4);
  for (const Snapshot::Point& p : points) {
    put(out, p.x / static_cast<float>(step));
    put(out, p.y / static_cast<float>(step));
    put(out, p.matched ? 1.0f : 0.0f);
  }
  return out;
}

}  // namespace evpose
