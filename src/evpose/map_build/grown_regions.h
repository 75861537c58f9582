// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/map_build/planes.h"

namespace evpose::map_build {

class Neighbours;

/// Normals and curvatures l0 / (l0 + l1 + l2) by principal components of each point's nearest neighbours, of
/// which there are always as many (EV-Pose, Map Construction: normal estimation). `tree` is of the points,
/// which are moved.
SurfacePoints describe_by_neighbours(std::vector<Eigen::Vector3f>&& points, const Neighbours& tree,
                                     const CloudScale& scale, ThreadPool& pool);

/// Plain region growing (EV-Pose, Map Construction: region growing, plane fitting): from the flattest point
/// that has no region yet, over neighbours whose normals turn by less than a limit from point to point; only
/// smooth points lead on. The plane of a region goes through all of its points.
Planes grow_regions(const SurfacePoints& surface);

}  // namespace evpose::map_build
