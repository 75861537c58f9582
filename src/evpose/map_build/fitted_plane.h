// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace evpose::map_build {

struct SurfacePoints;

/// A fitted plane, n . x + d = 0 with x relative to the cloud's anchor.
struct FittedPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double d = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of its points
  double rms_m = 0;                                  ///< of its points across it
  double spacing_m = 0;                              ///< median of its points'
  double uneven_m = 0;  ///< by which small parts of it lie off it beyond chance, 1 sigma
  /// Variances of the fit: of the offset at the centre, and of the tilts about the axes of its points.
  double offset_variance = 0;
  Eigen::Matrix3d tilt_covariance = Eigen::Matrix3d::Zero();
  std::vector<std::uint32_t> points;  ///< its own, ascending

  double distance(const Eigen::Vector3d& x) const { return normal.dot(x) + d; }
  /// Error of the normal's direction about its worse axis, 1 sigma, from the fit.
  double tilt_sigma_rad() const;
  /// Error across the plane at x, 1 sigma, from the fit.
  double sigma_at(const Eigen::Vector3d& x) const;
};

/// What the means of cells of a plane scatter beyond what their points' noise explains, 1 sigma.
double unevenness_m(const SurfacePoints& surface, const FittedPlane& plane);

/// The median noise of its points; that of the cloud where there is no local one.
double noise_on(const SurfacePoints& surface, const FittedPlane& plane);

}  // namespace evpose::map_build
