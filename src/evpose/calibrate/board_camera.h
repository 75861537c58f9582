// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/calibrate/board_finder.h"
#include "evpose/core/pose.h"
#include "evpose/core/time.h"

namespace evpose {

/// A board as it was seen at one time.
struct BoardView {
  TimeNs t = 0;
  LatticePixels pixels;
  Pose T_map_cam;     ///< map: the board's frame
  double rms_px = 0;  ///< of its points
  int recording = 0;  ///< in which it was seen
};

/// Where the camera stands, by the homography of the lattice's plane; none where no such pose sees it from
/// its front.
std::optional<Pose> pose_before_board(const Camera& camera, const BoardLattice& lattice,
                                      const LatticePixels& pixels);

/// The same by least squares in the image.
std::optional<Pose> best_pose_before_board(const Camera& camera, const BoardLattice& lattice,
                                           const LatticePixels& pixels);

struct BoardCamera {
  Eigen::VectorXd correction, sigma;  ///< of the given intrinsic numbers, in the order of corrected()
  double rms_px = 0;
};

/// Intrinsics and a pose for each view by least squares over all points, about intrinsics that are known to
/// within `covariance`. Views that do not fit are taken out. Errors: too few views; they fit no camera.
Expected<BoardCamera> fit_board_camera(const CameraIntrinsics& given, const Eigen::MatrixXd& covariance,
                                       const BoardLattice& lattice, std::vector<BoardView>* views);

}  // namespace evpose
