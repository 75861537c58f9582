// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace evpose {

/// An upright column of a cloud: what it answers for, without its high borders, and how far it looks beyond.
struct CloudTile {
  static constexpr float kNoBorder_m = 1e30F;  ///< where the cloud ends before the tile does

  Eigen::Vector2f low, high;  ///< relative to the cloud's anchor
  float overlap_m = 0;

  bool holds(const Eigen::Vector3f& p, float margin_m = 0) const {
    return p.x() >= low.x() - margin_m && p.y() >= low.y() - margin_m && p.x() < high.x() + margin_m &&
           p.y() < high.y() + margin_m;
  }
};

}  // namespace evpose
