// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/map_build/line_segment.h"
#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/outlines.h"

namespace evpose {
class ThreadPool;
}

namespace evpose::map_build {

class View;

struct BoundaryConfig {
  double least_length_m = 0.12;  ///< of a segment
  double most_sigma_m = 0.006;   ///< of a segment's place
  double most_blur_noise = 2;    ///< a real edge is no softer than so many times the noise; a shadow's is
};

/// What boundaries are found from; references and views must outlive the call.
struct BoundaryInput {
  const SurfacePoints& surface;
  const Neighbours& tree;  ///< finds the cloud's points
  const Planes& planes;
  const std::vector<bool>& unfit;                        ///< planes that have no contours
  const std::vector<Outline>& outlines;                  ///< of the planes
  const std::vector<std::vector<LineSegment>>& creases;  ///< of the planes
  std::span<const View> views;                           ///< where the cloud was seen from, if that is known
};

struct Boundaries {
  std::vector<LineSegment> segments;  ///< edges, arcs in chains of short segments, and shadows
  double left_out_m = 0;              ///< length of outlines left out: short, or unsure
};

/// For each plane the segments of its outline that no crease explains and that end like an edge, or that are
/// shadows: soft, or with something standing before what is beyond them.
std::vector<Boundaries> find_boundaries(const BoundaryInput& input, const BoundaryConfig& config,
                                        ThreadPool& pool);

}  // namespace evpose::map_build
