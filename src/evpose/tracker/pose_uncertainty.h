// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/fusion/state.h"

namespace evpose {

/// The pose's covariance as motion of a typical point's image.
class PoseUncertainty {
 public:
  /// `depth_m`: of the typical point.
  PoseUncertainty(const FusionState& state, double focal_px, double depth_m);

  /// 1 sigma in the weakest direction, px.
  double sigma_px() const { return sigma_px_; }
  /// That direction, in words.
  std::string weakest_direction() const;

 private:
  const FusionState& state_;
  double depth_m_, sigma_px_;
};

}  // namespace evpose
