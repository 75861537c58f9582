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

/// Which of the separated-polarity time surfaces (SP-TS, EV-Pose 4.1) is read.
enum class FieldPolarity : std::uint8_t { off, on, both };

/// Value and gradient of T_p(u) = exp(-(now - last_p(u)) / decay) between pixels, of one polarity or of the
/// newer of both: one minus the temporal distance field, TDF = 1 - T (EV-Pose 4.2). Evaluated where it is
/// read, never as an image.
struct FieldSample {
  double value = 0;                                    ///< 0 (no event) .. 1 (event now)
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  ///< per px
};

/// `pixel` within the image, at most one pixel from its border outwards; `decay_us` > 0.
FieldSample sample_field(const TimeSurface& surface, const Eigen::Vector2d& pixel, std::uint32_t now_us,
                         double decay_us, FieldKernel kernel, FieldPolarity polarity = FieldPolarity::both);

}  // namespace evpose
