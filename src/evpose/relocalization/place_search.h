// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "evpose/registration/pose_search.h"
#include "evpose/relocalization/attitude_search.h"
#include "evpose/relocalization/line_scores.h"
#include "evpose/relocalization/place_index.h"

namespace evpose {

/// Poses at the index' places inside of `box` with each of the attitudes, by how well the contours that are
/// seen there lie on the image's lines; best first, at most `most`. `score`: by how many standard deviations
/// of chance a pose stands above those at random.
std::vector<PoseGuess> search_places(std::span<const EdgeLine> lines, const Camera& camera,
                                     const Pose& T_body_cam, const PlaceIndex& index,
                                     const Eigen::AlignedBox3d& box, std::span<const AttitudeGuess> attitudes,
                                     std::size_t most);

}  // namespace evpose
