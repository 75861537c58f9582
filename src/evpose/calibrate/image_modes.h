// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

#include "evpose/camera/calibration_sigma.h"
#include "evpose/camera/camera.h"

namespace evpose {

/// Changes of a camera's n intrinsic numbers (as AdjustedCamera orders them), and last of an angle about the
/// optical axis, rad, each of which moves what is seen by up to one pixel in a way of its own. A turn about
/// another axis is none: the principal point can stand in for it. Empty: the model has no such number.
struct ImageModes {
  Eigen::VectorXd focal;           ///< both focal lengths alike
  Eigen::VectorXd cubic, quintic;  ///< radial terms without what lower ones can do (Zernike's polynomials)
  Eigen::VectorXd cx, cy, roll;
  std::array<const Eigen::VectorXd*, 6> all() const { return {&focal, &cx, &cy, &roll, &cubic, &quintic}; }
};
ImageModes image_modes(const CameraIntrinsics& camera, Eigen::Index n);

/// 1 sigma of an image in each of the modes but roll, px.
struct ImageSigma {
  double centre_px, focal_px, cubic_px, quintic_px;
  friend ImageSigma operator*(double k, const ImageSigma& s) {
    return {k * s.centre_px, k * s.focal_px, k * s.cubic_px, k * s.quintic_px};
  }
};

/// Once the image is known so well, at the given mounting R_body_cam: how far the numbers may be off, in the
/// order of CalibrationSigma::correlation, squares of px, rad, m and s. A turn of the camera goes with the
/// principal point that makes up for it. What no mode has is as given.
Eigen::MatrixXd covariance_of_found(const ImageModes& modes, const CameraIntrinsics& camera,
                                    const CalibrationSigma& given, const Eigen::Quaterniond& R_body_cam,
                                    const ImageSigma& image);

}  // namespace evpose
