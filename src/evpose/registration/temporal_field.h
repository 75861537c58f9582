// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "evpose/event/time_surface.h"

namespace evpose {

/// How the field between pixel centres follows from their values.
enum class FieldKernel {
  bilinear,  ///< the paper's: exact at pixel centres, slope jumps there
  spline,    ///< cubic B-spline: smooths over +-2 px, slope continuous
};

/// Value and gradient of T(u) = max over polarities of exp(-(now - last(u)) / decay) between pixels: one
/// minus the temporal distance field (EV-Pose 4.2). Evaluated where it is read, never as an image.
struct FieldSample {
  double value = 0;                                    ///< 0 (no event) .. 1 (event now)
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  ///< per px
};

/// `pixel` within the image, at most one pixel from its border outwards; `decay_us` > 0.
FieldSample sample_field(const TimeSurface& surface, const Eigen::Vector2d& pixel, std::uint32_t now_us,
                         double decay_us, FieldKernel kernel);

}  // namespace evpose
