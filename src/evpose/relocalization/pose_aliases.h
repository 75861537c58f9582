// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/registration/pose_search.h"
#include "evpose/relocalization/attitude_search.h"

namespace evpose {

/// What is seen from a pose of the body, map frame.
using ViewFrom = std::function<SearchView(const Pose& T_map_body)>;

/// Perceptual aliases: poses moved from this one along one of the map's three main directions by up to some
/// metres, where contours lie on edges again. Repetitive places, as facades of windows all alike, have them,
/// and a pose that is wrong by a period has the true one among them. Best first, at most six, refined.
std::vector<PoseGuess> find_aliases(const Pose& T_map_body, std::span<const MapDirection> directions,
                                    const ViewFrom& view_from);

}  // namespace evpose
