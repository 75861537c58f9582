// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/map/contour_map.h"
#include "evpose/relocalization/attitude_search.h"
#include "evpose/relocalization/edge_lines.h"

namespace evpose {

/// Attitudes near a known one, better than by degrees, from a slice of events without rotation: those from
/// which its straight edges look parallel to the map's main directions (search_attitude()).
class AttitudeFinder {
 public:
  /// Of the attitudes that are found: half a degree to a degree and a half in the room of the benchmarks.
  static constexpr double kSigma_rad = 0.014;

  AttitudeFinder(const ContourMap& map, const Camera& camera);

  /// A prior that is known worse than what is found, largest standard deviation.
  static bool suits(const Eigen::Matrix3d& covariance);
  /// R_map_body of the likeliest, at most three, best first; none without lines or directions. `covariance`:
  /// of the prior, rad^2, as R exp(phi).
  std::vector<Eigen::Quaterniond> find(std::span<const FilteredEvent> events,
                                       const Eigen::Quaterniond& q_body_cam,
                                       const Eigen::Quaterniond& prior_q_map_body,
                                       const Eigen::Matrix3d& covariance);
  /// The map's.
  std::span<const MapDirection> directions() const { return directions_; }

 private:
  const Camera& camera_;
  std::vector<MapDirection> directions_;
  EdgeLineFinder lines_;
};

}  // namespace evpose
