// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/map_build/line_segment.h"
#include "evpose/map_build/planes.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::map_build {

class Neighbours;

struct CreaseConfig {
  double least_angle_rad = 0.35;  ///< between two planes that make a crease
  double least_length_m = 0.08;   ///< of a segment
  double most_sigma_m = 0.006;    ///< of a segment's place
};

/// Where two planes meet: segments of the line in which they intersect, as far as both have points up to it.
/// Near the line each plane is fitted again to the points beside it: walls carry skirtings, floors sag, scans
/// are registered to a centimetre. Ends near a third plane that touches one of the two go to the point where
/// the three meet. Planes that are `unfit` make none. Doubtful are those in whose corner something
/// stands, more likely than not.
std::vector<LineSegment> find_creases(const SurfacePoints& surface, const Neighbours& tree,
                                      const Planes& planes, const std::vector<bool>& unfit,
                                      const CreaseConfig& config, ThreadPool& pool);

}  // namespace evpose::map_build
