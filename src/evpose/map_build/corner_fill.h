// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>

namespace evpose::map_build {

/// What may stand in the corner of two faces at right angles, a kerb, a plinth or a skirting: it reaches
/// `width_m` along the first face and `height_m` along the second, and has edges there while the corner has
/// none.
struct CornerFill {
  double probability = 0;  ///< that there is such a thing
  // If there is one: means and standard deviations.
  double width_m = 0, height_m = 0, sigma_width_m = 0, sigma_height_m = 0;
};

/// Of points by their heights over the first and the second face, positive between the faces, up to
/// `window_m`; `noise_m`: of a height, 1 sigma. Points are a mixture of both faces, the thing's top and
/// front, and a rest. Before they speak, something stands in three corners of ten, of any size from the noise
/// to 12 cm alike, as dense as the faces, its top or its front perhaps hidden.
CornerFill corner_fill(std::span<const Eigen::Vector2d> points, double noise_m, double window_m);

}  // namespace evpose::map_build
