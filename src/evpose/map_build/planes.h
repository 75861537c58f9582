// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/map_build/surface_points.h"

namespace evpose::map_build {

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

struct Planes {
  std::vector<FittedPlane> planes;
  std::vector<std::int32_t> label;  ///< plane of each point, -1: none
};

struct PlaneConfig {
  double angle_rad = 0.30;   ///< most between a point's normal and its plane
  double gate_sigma = 3;     ///< most distance of a point from its plane, in units of the noise
  double least_patches = 1;  ///< points of a plane, in patches that tell a normal
  /// Rms of a plane that has contours, in units of the typical plane's.
  double most_rough = 2;
  double most_tilt_rad = 0.02;  ///< error of the direction of a plane that has contours, 1 sigma
  double merge_rad = 0.026;     ///< planes that touch and agree to this angle and to the noise become one
};

/// Region growing on normals, from the flattest points on (EV-Pose, Map Construction): each region follows
/// the plane fitted to it so far, so that it cannot creep around a bend. Points in the bends, whose normals
/// belong to neither side, go to the nearest plane beside them afterwards, and have no part in the fits.
Planes find_planes(const SurfacePoints& surface, const PlaneConfig& config);

}  // namespace evpose::map_build
