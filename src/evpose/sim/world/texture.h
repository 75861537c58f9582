// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/sim/world/lanes.h"
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

  /// The same at eight places, or at one.
  template <class V>
  struct Footprint {
    V u, v, a_u, a_v, b_u, b_v;
  };
  template <class V>
  V mean(const Footprint<V>& at) const;

  std::size_t bytes() const;

 private:
  template <class V>
  struct Filter;
  template <class V>
  Filter<V> filter(const Footprint<V>& at) const;
  template <class V>
  struct Level;
  template <class V>
  Level<V> level(typename LaneTypes<V>::Int number) const;
  template <class V>
  V sample(const Level<V>& level, V u, V v) const;
  void add_level(int columns, int rows, const std::vector<std::uint16_t>& values);

  float width_, height_, texel_;
  // Each level is stored with its first column and row once more at the end.
  std::vector<std::uint16_t> values_;
  std::vector<float> columns_, rows_;         ///< of each level
  std::vector<std::int32_t> first_, stride_;  ///< of each level, in `values_`
};

}  // namespace evpose::sim
