// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace evpose::sim {

/// Reflectance over a rectangle, kept as a table of sums: its mean over any axis-parallel box takes the same
/// few reads, so that a pixel integrates what it sees, however coarse or slanted, and nothing twinkles.
class Texture {
 public:
  /// `reflectance` in [0, 1] of (u, v) in metres from the lower left corner; sampled once per texel.
  Texture(double width_m, double height_m, double texel_m,
          const std::function<double(double u_m, double v_m)>& reflectance);

  /// Mean over the box of size (width, height) around (u, v), metres; the box is at least a texel wide and is
  /// cut at the rectangle's border.
  double mean(double u_m, double v_m, double width_m, double height_m) const;

 private:
  int columns_, rows_;
  double texels_per_m_u_, texels_per_m_v_;
  std::vector<std::int32_t> sums_;  ///< (columns + 1) x (rows + 1), in 1/255 of reflectance
};

}  // namespace evpose::sim
