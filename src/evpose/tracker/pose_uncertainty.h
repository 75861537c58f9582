// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/camera/camera.h"
#include "evpose/fusion/state.h"

namespace evpose {

/// The pose's covariance as motion of the image, 1 sigma.
class PoseUncertainty {
 public:
  /// What the camera sees: points at `depth_m`, a typical distance of the scene, all over the image.
  struct View {
    const Camera& camera;
    const Pose& T_body_cam;
    double depth_m;
  };
  PoseUncertainty(const FusionState& state, const View& view);

  /// Of the points, rms, each in its weakest direction; position and rotation together, which may be far
  /// less sure than how the scene lies in the image. Px.
  double image_px() const;
  /// Of position alone and of rotation alone, the larger one, in the weakest direction. Px at the centre.
  double separate_px() const { return separate_px_; }
  /// That direction, in words.
  std::string weakest_direction() const;

 private:
  const FusionState& state_;
  View view_;
  double separate_px_;
};

}  // namespace evpose
