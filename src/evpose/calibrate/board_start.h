// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "evpose/calibrate/board_camera.h"
#include "evpose/camera/calibration_sigma.h"
#include "evpose/io/recording/recording.h"
#include "evpose/map/board.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Where a recording begins as its pictures of the board have it.
class BoardSighting {
 public:
  /// `views`: one, or three near each other: the start is the middle one.
  BoardSighting(BoardLattice lattice, std::vector<BoardView> views)
      : lattice_(std::move(lattice)), views_(std::move(views)) {}

  bool tells_velocity() const { return views_.size() > 1; }
  /// Seen with this camera; none where it does not see the board.
  std::optional<StartState> start(const Camera& camera, const Pose& T_cam_body) const;

 private:
  BoardLattice lattice_;
  std::vector<BoardView> views_;
};

/// Where recordings before a printed board begin, and the camera, by pictures that are made of their events.
struct BoardStart {
  std::vector<StartState> starts;
  std::vector<BoardSighting> sightings;  ///< of each recording
  /// In the board's frame, which stays where it is in all recordings, m/s^2; none without an IMU.
  std::optional<Eigen::Vector3d> gravity;
  Eigen::VectorXd correction, sigma;  ///< of the given intrinsic numbers, in the order of corrected()
  std::size_t views = 0;              ///< of the board, in all recordings
  double rms_px = 0;
};

/// All recordings with the intrinsics of the first, which are known to within `sigma`. `progress` is told the
/// share of the work and ends it by false; then there is no result. Errors: an unreadable recording; a board
/// that is never seen, or whose points fit no camera; a program without the library that finds it.
Expected<std::optional<BoardStart>> find_board_start(const std::vector<Recording>& recordings,
                                                     const Board& board, const CameraIntrinsics& given,
                                                     const CalibrationSigma& sigma,
                                                     const std::function<bool(double)>& progress);

}  // namespace evpose
