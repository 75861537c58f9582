// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/map/contour_map.h"
#include "evpose/relocalization/edge_lines.h"

namespace evpose {

/// A direction that many of a map's contours have.
struct MapDirection {
  Eigen::Vector3d axis;  ///< unit, map frame; its sign means nothing
  double share;          ///< of the contours' length
};

/// The main directions of a map's straight contours, at most six, the most frequent first.
std::vector<MapDirection> main_directions(const ContourMap& map);

/// What is known of the attitude before.
struct AttitudePrior {
  Eigen::Vector3d up_body;                                           ///< unit: specific force
  Eigen::Quaterniond heading_from = Eigen::Quaterniond::Identity();  ///< R_map_body
  double heading_within = 10;  ///< rad about the map's z from that; above pi: not known
  double turned_within = 10;   ///< rad about any axis from that, likewise
};

struct AttitudeGuess {
  Eigen::Quaterniond q_map_body;
  double score = 0;  ///< log likelihood of the lines' directions, against lines at random
};

/// Attitudes from which the image's lines look parallel to the map's main directions, best first; at most
/// `most` that differ by some degrees. In rooms with walls at right angles, there are four. Empty if the map
/// has fewer than two directions or the image no lines.
std::vector<AttitudeGuess> search_attitude(std::span<const EdgeLine> lines, const Camera& camera,
                                           const Eigen::Quaterniond& q_body_cam,
                                           std::span<const MapDirection> directions,
                                           const AttitudePrior& prior, std::size_t most);

}  // namespace evpose
