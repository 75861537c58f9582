// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/outlines.h"
#include "evpose/map_build/piece.h"

namespace evpose::map_build {

struct BoundaryConfig {
  double least_length_m = 0.12;  ///< of a piece
  double most_sigma_m = 0.008;   ///< of a piece's place
  double most_blur_noise = 2;    ///< a real edge is no softer than so many times the noise; a shadow's is
};

/// Where a density of points ends along a straight line: density * Phi(-(d - place - slope t) / blur) + rest.
struct StepFit {
  double place = 0, slope = 0;  ///< of the edge at t = 0, and per metre of t
  double blur_m = 0;            ///< 1 sigma
  double sigma_place = 0, sigma_slope = 0;
  double rest = 0;     ///< density beyond, as a share of that within
  double density = 0;  ///< within, per square metre
  double log_likelihood = 0;
  bool converged = false;
};

/// Maximum likelihood for points (t along, d across, outwards positive) in a strip of |t| <= half_length,
/// |d| <= half_width: a Poisson process whose density falls off as an edge blurred by noise. Unlike the
/// outermost points, whose distance from the edge depends on the density, the step is not drawn inwards or
/// outwards.
StepFit fit_step(std::span<const Eigen::Vector2d> points, double half_length, double half_width,
                 double blur_m);

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
