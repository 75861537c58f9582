// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/outlines.h"
#include "evpose/map_build/piece.h"
#include "evpose/map_build/step_fit.h"

namespace evpose::map_build {

struct BoundaryConfig {
  double least_length_m = 0.12;  ///< of a piece
  double most_sigma_m = 0.006;   ///< of a piece's place
  double most_blur_noise = 2;    ///< a real edge is no softer than so many times the noise; a shadow's is
};

struct Boundaries {
  std::vector<Piece> pieces;
  double shadow_m = 0;  ///< length of outlines left out: soft, or where the surface goes on
};

/// Pieces of a plane's outline that no crease explains and that end like an edge. `creases` are those of the
/// plane; `tree` finds the cloud's points.
Boundaries find_boundaries(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
                           std::int32_t number, const Outline& outline, const std::vector<Piece>& creases,
                           const BoundaryConfig& config);

}  // namespace evpose::map_build
