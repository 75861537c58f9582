// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/sim/world/patterns.h"

namespace evpose::sim {

/// Reflectance over a rectangle that repeats in both directions, as a mipmap with anisotropic filtering: a
/// pixel gets the mean over its footprint, without aliasing.
class Texture {
 public:
  /// The pattern from (0, 0) to (width, height), sampled once per texel. A pattern that is not periodic has
  /// a seam at the borders, which is invisible on surfaces no larger than the rectangle.
  Texture(double width_m, double height_m, double texel_m, const Pattern& pattern);

  /// Mean around (u, v), metres, over the parallelogram spanned by `a` and `b`, metres.
  float mean(float u_m, float v_m, const Eigen::Vector2f& a_m, const Eigen::Vector2f& b_m) const;

  std::size_t bytes() const;

 private:
  struct Level {
    int columns, rows;
    std::vector<std::uint16_t> values;
  };
  float sample(const Level& level, float u, float v) const;

  float width_, height_, texel_;
  std::vector<Level> levels_;
};

}  // namespace evpose::sim
