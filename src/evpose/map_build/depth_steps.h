// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>

namespace evpose::map_build {

struct DepthStep {
  double step_m = 0;                                 ///< 0: there is none
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< of the layers, unit, of either sign
};

/// The step that depth is rounded to, as the layers that its points lie in tell: from the layer of the first
/// points to the nearest one parallel to it. `around` is relative to the first of them, nearest first;
/// `exact_m` is how thick a layer may be. None if the first points are in no layer, if no other layer is
/// seen, or if what lies off the layer is at all distances, as beside the edge of a surface without noise.
DepthStep find_depth_step(std::span<const Eigen::Vector3d> around, double exact_m);

}  // namespace evpose::map_build
