// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/map_learn/trajectory.h"
#include "evpose/run/track_recording.h"

namespace evpose::map_learn {

/// A straight edge as one reference view of a space sweep has it, map frame, m.
struct SweptPiece {
  Eigen::Vector3d a, b;
  Eigen::Vector3d ray;  ///< unit, from the view to its middle
  double across_sigma_m = 0, along_ray_sigma_m = 0;
  double significance = 0;
  int view = 0;  ///< number of the reference view
};

/// Pieces that at least two reference views share, each once, where these together put it; its sigma along
/// the ray is that of all.
std::vector<SweptPiece> shared_pieces(std::vector<SweptPiece> pieces);

/// Straight edges that the map has not, on its planes or off them, by space sweeps along a flight: as
/// contours of unknown contrast and of kind `boundary`, numbered from `first_contour` on. `progress`: as of
/// feed_recording(). Error: of the recording.
Expected<std::vector<ContourPoint>> find_depth_edges(const TrackJob& job, const Trajectory& trajectory,
                                                     std::int32_t first_contour,
                                                     const std::function<bool(double)>& progress);

}  // namespace evpose::map_learn
