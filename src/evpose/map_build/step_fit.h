// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>

namespace evpose::map_build {

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

}  // namespace evpose::map_build
