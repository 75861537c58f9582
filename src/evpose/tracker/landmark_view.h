// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "evpose/camera/adjusted_camera.h"
#include "evpose/core/pose.h"
#include "evpose/fusion/back_end.h"

namespace evpose {

/// A landmark that was placed by one look of the camera and is seen by another.
struct LandmarkView {
  const Pose& T_map_body;   ///< now
  const Pose& T_map_kept;   ///< when it was found
  const Pose& T_kept_then;  ///< of the look that placed it, a little earlier
  const Pose& T_body_cam;
  Eigen::Vector3d point_then;  ///< camera frame of that look

  /// Camera frame, now.
  Eigen::Vector3d point_now() const;
};

/// How the landmark's distance to its events, px along `normal_px`, depends on what RelativeInformation is
/// of. `by_pose`: on the pose alone (ContourSample::jacobian). The surface that it lies on is known where the
/// camera's numbers change, its place on that is not. `adjusted`: null where the numbers are known.
RelativeInformation::Vector landmark_row(const LandmarkView& view, const Vector6d& by_pose,
                                         const Eigen::Vector2d& normal_px, const AdjustedCamera* adjusted);

}  // namespace evpose
