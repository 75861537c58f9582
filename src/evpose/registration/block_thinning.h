// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>

#include "evpose/camera/camera.h"

namespace evpose {

/// Which blocks of the image are looked at in an update, where not all of them can be: a share of them,
/// spread evenly over the image, and others at the next turn, so that each is looked at in its share of the
/// turns.
class BlockThinning {
 public:
  /// Takes all.
  BlockThinning() = default;
  /// `share`: 0..1; `turn`: counts the updates.
  BlockThinning(ImageSize size, double share, std::int64_t turn)
      : block_px_(block_px(size)),
        share_(std::clamp(share, 0.0, 1.0)),
        below_(static_cast<std::uint64_t>(share_ * kWhole)),
        phase_(static_cast<std::uint32_t>(turn) * kPerTurn) {}

  /// Edge of a block.
  static int block_px(ImageSize size) { return std::max(1, size.width / kBlocksPerWidth); }

  double share() const { return share_; }
  bool takes_all() const { return share_ >= 1; }
  /// Whether the block of this pixel is looked at; any coordinates.
  bool takes(const Eigen::Vector2d& pixel) const {
    const std::uint32_t column = block_of(pixel.x()), row = block_of(pixel.y());
    return column * kPerColumn + row * kPerRow + phase_ < below_;
  }

 private:
  static constexpr int kBlocksPerWidth = 20;  ///< 32 px at VGA
  static constexpr double kWhole = 4294967296.0;
  // Steps of the R2 sequence, which fills the plane evenly, and of the golden ratio over the turns.
  static constexpr std::uint32_t kPerColumn = 0xC13FA9A9, kPerRow = 0x91E10DA5, kPerTurn = 0x9E3779B9;

  std::uint32_t block_of(double v) const {
    constexpr double kFar = 32768;
    return static_cast<std::uint32_t>(std::clamp(v / block_px_, -kFar, kFar) + kFar);
  }

  int block_px_ = 1;
  double share_ = 1;
  std::uint64_t below_ = std::uint64_t{1} << 32;
  std::uint32_t phase_ = 0;
};

}  // namespace evpose
